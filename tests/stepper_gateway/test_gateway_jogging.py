"""Jogging through the gateway on the real firmware core: executed within the limits, stopped exactly."""

from __future__ import annotations

import math

import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.planning import JogCommand, JogStatus
from gemelo.schemas.topics import DEVICE_EVENTS, JOINT_STATES
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.jog import PERIOD, Jog
from gemelo.tools.virtual_arm.gateway_driver import TargetsInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import assert_within_limits, move

CALM = ("boot", "armed", "hold", "connected", "accepted", "started", "finished", "stopped")
TURN = JogCommand(name=("brazo_joint", "antebrazo_joint"), velocity=(0.6, -0.4))


class JoggedRig:
    """A planner's jog beside the gateway."""

    def __init__(self, start: tuple[float, ...] = (0.6, -1.2, 0.08)) -> None:
        self.rig = VirtualArm(start=start).ready()
        kinematics = Kinematics(rm1())
        self.world = World(rm1(), kinematics)
        self.jog = Jog(rm1(), kinematics, self.world)
        self.statuses: list[JogStatus] = []
        self.goal_is_active = False
        self.nearest = math.inf  # [m]
        self.led: tuple[float, ...] = ()  # where to, of late

    def hold(self, command: JogCommand | None, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            if command is not None:
                self.jog.on_command(command, self.rig.now)
            state = self.rig.messages(JOINT_STATES)[-1]
            output = self.jog.step(self.rig.now, self.rig.moment.unix, state, 0.02, self.goal_is_active)
            if output.targets is not None:
                self.rig.handle(TargetsInput(output.targets, watched=True))
            if self.jog.commanded is not None:
                self.led = tuple(self.jog.commanded[0].tolist())
            if output.status is not None:
                self.statuses.append(output.status)
            self.rig.run(PERIOD)
            self.nearest = min(self.nearest, self.world.distance(self.rig.position))

    @property
    def faults(self) -> list[str]:
        told = [event.event for event in self.rig.messages(DEVICE_EVENTS)]
        return [event for event in told if event not in CALM]


def test_the_device_jogs_within_the_limits_and_stops_exactly_where_it_was_led() -> None:
    jogged = JoggedRig()
    jogged.hold(TURN, 1.0)
    jogged.hold(JogCommand(linear=(0.0, 0.08, 0.02)), 1.0)
    jogged.hold(None, 3.0)
    assert not jogged.jog.is_busy
    assert jogged.faults == []
    assert jogged.rig.device.mode == DeviceMode.IDLE
    for joint, executed, wanted in zip(rm1().joints, jogged.rig.position, jogged.led, strict=True):
        assert executed == pytest.approx(wanted, abs=0.51 * joint.steps.resolution)
    assert_within_limits(jogged.rig)


def test_a_dead_planner_leaves_the_arm_clear_and_at_rest() -> None:
    jogged = JoggedRig(start=(0.0, 2.0, 0.08))
    jogged.hold(JogCommand(name=("antebrazo_joint", "brazo_joint"), velocity=(0.8, 0.8)), 0.8)
    jogged.rig.run(2.0)
    assert jogged.rig.device.mode == DeviceMode.IDLE
    assert jogged.faults == []
    assert jogged.world.distance(jogged.rig.position) >= CLEARANCE
    assert_within_limits(jogged.rig)


def test_driven_into_its_own_limits_the_device_never_comes_nearer_than_the_clearance() -> None:
    jogged = JoggedRig(start=(0.0, 1.5, 0.0))
    jogged.hold(JogCommand(name=("antebrazo_joint", "efector_joint"), velocity=(1.5, 0.03)), 4.0)
    jogged.hold(None, 1.5)
    assert any(status.limited_by for status in jogged.statuses)
    assert jogged.nearest >= CLEARANCE
    assert jogged.faults == []
    assert_within_limits(jogged.rig)


def test_a_goal_refuses_jogging_and_takes_over_from_it_without_a_jump() -> None:
    jogged = JoggedRig()
    jogged.hold(TURN, 0.8)
    here = jogged.rig.messages(JOINT_STATES)[-1].position
    assert jogged.rig.goal(move(here, (0.2, 0.2, 0.05))).accepted
    jogged.goal_is_active = True
    jogged.hold(TURN, 0.4)
    assert not jogged.statuses[-1].active
    assert "a goal is being carried out" in jogged.statuses[-1].limited_by
    assert jogged.rig.finish()[0].name == "SUCCEEDED"
    jogged.goal_is_active = False
    jogged.hold(None, 1.0)
    jogged.hold(TURN, 0.6)
    assert jogged.statuses[-1].active
    assert abs(jogged.rig.position[0] - 0.2) < 0.3
    jogged.hold(None, 2.0)
    assert_within_limits(jogged.rig)
