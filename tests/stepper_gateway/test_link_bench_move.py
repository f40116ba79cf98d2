"""`gemelo link bench --move` on the real gateway and firmware cores, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gemelo.schemas.device import DeviceMode, EchoRequest, EchoResponse
from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.topics import DEVICE_ECHO, JOINT_STATES, JOINT_TARGETS
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import CommandSession
from gemelo.tools.cli.device.link_bench import SWING, measure, swinging
from gemelo.tools.virtual_arm.gateway_driver import EchoInput, TargetsInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.stepper_gateway.harness import assert_within_limits

DELAY = 0.004  # [s] of the wire, each way
SWUNG, AMOUNT = "brazo_joint", 0.2  # [rad]
MOVE = f"{SWUNG}={AMOUNT}rad"


class VirtualNode:
    """What the command asks of its node, answered by a virtual arm; time passes while it waits."""

    def __init__(self, rig: VirtualArm) -> None:
        self._rig, self._tickets = rig, 0

    def monotonic(self) -> float:
        return self._rig.now

    def wait(self, seconds: float) -> None:
        self._rig.run(seconds)

    def call(self, service: object, _request: EchoRequest, timeout: float) -> EchoResponse:
        assert service is DEVICE_ECHO
        self._tickets += 1
        ticket = self._tickets
        self._rig.handle(EchoInput(ticket))
        assert self._rig.run(timeout, lambda: ticket in self._rig.echoed)
        return self._rig.echoed.pop(ticket)

    def latest(self, topic: object) -> Any:
        assert topic is JOINT_STATES
        rig = self._rig

        class Newest:
            @property
            def message(self) -> JointState | None:
                states = rig.messages(JOINT_STATES)
                return states[-1] if states else None

        return Newest()

    def publisher(self, topic: object) -> Any:
        assert topic is JOINT_TARGETS
        rig = self._rig

        def put(targets: JointTargets) -> None:
            rig.handle(TargetsInput(targets))

        return SimpleNamespace(put=put)


def session_of(rig: VirtualArm) -> CommandSession:
    return cast(CommandSession, SimpleNamespace(node=VirtualNode(rig), arm=rm1()))


def bench(rig: VirtualArm, swing: Callable[[float], None], seconds: float) -> list[float | None]:
    measured = measure(session_of(rig), 25.0, round(25.0 * seconds), swing)
    assert measured.took == pytest.approx(seconds, abs=0.1)
    return measured.trips


def test_the_joint_swings_about_where_it_was_and_the_wire_is_as_quick_as_before() -> None:
    rig = VirtualArm(VirtualWire(delay=DELAY)).ready()
    index = rm1().joint_names.index(SWUNG)
    still = bench(rig, lambda _elapsed: None, 1.0)
    begun = len(rig.messages(JOINT_STATES))
    before = rig.messages(JOINT_STATES)[-1].position
    swung = bench(rig, swinging(session_of(rig), MOVE), 2.0 * SWING)
    places = [state.position for state in rig.messages(JOINT_STATES)[begun:]]
    moved = [place[index] - before[index] for place in places]
    assert max(moved) == pytest.approx(AMOUNT, rel=0.1)
    assert min(moved) == pytest.approx(-AMOUNT, rel=0.1)
    others = [i for i in range(3) if i != index]
    assert all(place[i] == before[i] for place in places for i in others)
    assert None not in swung
    trips = [trip for trip in swung if trip is not None]
    assert min(trips) >= 2.0 * DELAY
    assert max(trips) <= max(trip for trip in still if trip is not None) + 0.002
    assert_within_limits(rig)


def test_when_the_measurement_ends_the_arm_comes_to_rest_without_losing_a_step() -> None:
    rig = VirtualArm(VirtualWire(delay=DELAY)).ready()
    bench(rig, swinging(session_of(rig), MOVE), 1.6)
    assert rig.device.mode is DeviceMode.RUN
    rig.run(3.0)
    assert rig.device.mode is DeviceMode.IDLE
    assert rig.device.shaft == rig.device.steps
    assert rig.device.max_slot_error <= 128


def test_a_joint_that_is_none_is_refused_and_a_silent_arm_is_said_to_be_so() -> None:
    rig = VirtualArm().ready()
    with pytest.raises(CommandError, match="elbow"):
        swinging(session_of(rig), "elbow=0.2rad")
    rig.published[JOINT_STATES.key].clear()
    rig.lost.add("state")
    with pytest.raises(CommandError, match="nothing heard of the arm") as silent:
        swinging(session_of(rig), MOVE)
    assert silent.value.code is ExitCode.NO_STACK
