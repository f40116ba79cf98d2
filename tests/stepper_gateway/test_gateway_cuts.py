"""Frames that do not arrive, in either direction, at any moment: each goal and command ends in time, and truly."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, InjectKind, InjectRequest, StopKind
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.services.stepper_gateway.links.frames import Code, CommandReply, decode
from gemelo.services.stepper_gateway.links.link import FROM_DEVICE, TO_DEVICE, Kind
from gemelo.tools.virtual_arm.gateway_driver import CancelInput, ConfigureInput, InjectInput, asked
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire
from tests.profiles import examples
from tests.stepper_gateway.harness import move

HOME, READY = (0.0, 0.0, 0.0), (0.6, -1.2, 0.08)
JAWS = 0.05  # [m]
DEAF = 2.0  # [s] after which a device that answers nothing counts as unreachable
BEHIND = 9.0  # [s] after a trajectory's length: 2 s by which it may be late, DEAF, and 2 s for each of two STOPs
COMMAND = 2.3  # [s] of a command: its time-out, and the state that shows it
GRIP = 5.5  # [s] of a gripper goal: the jaws' longest way, and 3 s
CONFIGURATION = 5.1  # [s]
WHILE = st.one_of(st.just(60.0), st.floats(0.05, 5.0))  # [s] that a cut lasts


class Cut(NamedTuple):
    """Kinds of frames that do not arrive, from when on and for how long [s]."""

    kinds: frozenset[str]
    begins: float
    lasts: float
    loss: float  # of what else is sent, before and after


DIRECTIONS = (frozenset(TO_DEVICE), frozenset(FROM_DEVICE), frozenset(Kind))
KINDS = st.one_of(st.sampled_from(DIRECTIONS), st.frozensets(st.sampled_from(sorted(Kind)), min_size=1, max_size=4))
CUTS = st.builds(Cut, KINDS, st.floats(0.0, 3.0), WHILE, st.sampled_from((0.0, 0.0, 0.3)))


class Witnessed(VirtualArm):
    """Keeps what the device has answered to commands, whether or not that arrives."""

    def __init__(self) -> None:
        self.accepted_by_device: set[int] = set()  # kinds of commands
        super().__init__(VirtualWire(spared=()), step_us=5000)

    def _launch(self, to_device: bool, kind: str, payload: bytes) -> None:
        if kind == Kind.CMD_ACK:
            reply = decode(payload)
            assert isinstance(reply, CommandReply)
            self.accepted_by_device |= {reply.cmd} if reply.code == Code.OK else set()
        super()._launch(to_device, kind, payload)


class Lost:
    """An arm whose wire loses what a cut says, from now on."""

    def __init__(self, cut: Cut) -> None:
        self.rig = Witnessed()
        self.rig.ready()
        self.rig.wire.loss = cut.loss
        self._cut, self._began = cut, self.rig.now

    def ends(self, seconds: float, is_over: Callable[[], bool]) -> bool:
        """Lets at most `seconds` [s] pass; true if it is over."""
        edges = (self._began + self._cut.begins, self._began + self._cut.begins + self._cut.lasts)
        deadline = self.rig.now + seconds
        while self.rig.now < deadline and not is_over():
            self.rig.lost = set(self._cut.kinds) if edges[0] <= self.rig.now < edges[1] else set()
            coming = [edge for edge in edges if edge > self.rig.now]
            self.rig.run(min([deadline, *coming]) - self.rig.now + 1e-6, is_over)
        return is_over()


def assert_at(rig: VirtualArm, target: tuple[float, ...]) -> None:
    """The device itself stands there, whatever was reported."""
    assert not rig.device.moving
    rows = zip(rig.arm.joints, target, rig.device.steps, strict=True)
    assert max(abs(joint.steps.to_steps(there) - steps) for joint, there, steps in rows) <= 1.0


@given(CUTS)
@examples(quick=7, full=100)
def test_every_goal_ends_in_time_and_a_success_is_true(cut: Cut) -> None:
    lost = Lost(cut)
    trajectory = move(HOME, READY)
    verdict = lost.rig.goal(trajectory)
    assert verdict.accepted, verdict.reason
    length = trajectory.points[-1].time_from_start
    assert lost.ends(length + BEHIND, lambda: "g" in lost.rig.finished), "the goal does not end"
    status, result = lost.rig.finished["g"]
    if status is GoalStatusCode.SUCCEEDED:
        assert_at(lost.rig, READY)
    else:
        assert result.error_string


@given(CUTS, st.floats(0.0, 3.0))
@examples(quick=5, full=60)
def test_every_cancelled_goal_ends_in_time_and_the_arm_does_not_go_on_by_itself(cut: Cut, when: float) -> None:
    lost = Lost(cut)
    rig = lost.rig
    assert rig.goal(move(HOME, READY)).accepted
    lost.ends(when, lambda: "g" in rig.finished)
    rig.handle(CancelInput("g"))
    assert lost.ends(BEHIND, lambda: "g" in rig.finished), "the cancelled goal does not end"
    lost.ends(4.0, lambda: not rig.device.moving and rig.device.mode is not DeviceMode.RUN)
    stood = rig.device.steps
    rig.lost, rig.wire.loss = set(), 0.0
    rig.run(3.0)
    assert rig.device.steps == stood


@given(CUTS, st.sampled_from((JAWS, 0.0, 0.02)))
@examples(quick=5, full=60)
def test_every_goal_of_the_gripper_ends_in_time(cut: Cut, position: float) -> None:
    lost = Lost(cut)
    if lost.rig.grip(position).accepted:
        assert lost.ends(GRIP, lambda: "grip" in lost.rig.gripped), "the gripper's goal does not end"


COMMANDS = tuple(
    DeviceCommandKind[name]
    for name in ("ARM", "HOME", "REFERENCE", "RESET", "RESUME", "SPEED", "STOP", "HOLD", "DISARM")
)


@given(CUTS, st.floats(0.0, 3.2), st.lists(st.sampled_from(COMMANDS), min_size=1, max_size=3))
@examples(quick=7, full=100)
def test_every_command_is_answered_in_time_and_what_was_accepted_was_done(
    cut: Cut, when: float, wanted: list[DeviceCommandKind]
) -> None:
    lost = Lost(cut)
    rig = lost.rig
    lost.ends(when, lambda: False)
    rig.accepted_by_device.clear()
    for ticket, each in enumerate(wanted, 1):
        rig.ask(asked(each), ticket)
    assert lost.ends(COMMAND, lambda: len(rig.answers) == len(wanted)), "a command is not answered"
    for ticket, each in enumerate(wanted, 1):
        answer = rig.answers[ticket]
        assert answer.accepted or answer.reason
        assert not answer.accepted or each in rig.accepted_by_device, f"{each.name} was accepted by nobody"


@given(CUTS, st.floats(0.0, 3.2))
@examples(quick=4, full=60)
def test_a_configuration_and_an_injection_are_answered_in_time(cut: Cut, when: float) -> None:
    lost = Lost(cut)
    rig = lost.rig
    lost.ends(when, lambda: False)
    rig.handle(ConfigureInput(1))
    rig.handle(InjectInput(2, InjectRequest(kind=InjectKind.DRIFT, value=0.0)))
    assert lost.ends(CONFIGURATION, lambda: 1 in rig.configured and 2 in rig.pressed), "no answer"


@pytest.mark.parametrize("kinds", [frozenset(TO_DEVICE), frozenset({Kind.SYNC}), frozenset({Kind.SYNC_R})])
def test_a_device_that_answers_nothing_is_not_ready_within_two_seconds_and_says_why(kinds: frozenset[str]) -> None:
    rig = VirtualArm().ready()
    rig.lost = set(kinds)
    assert rig.run(DEAF, lambda: "speaks and does not hear" in rig.reason_not_ready)
    assert all(word in rig.reason_not_ready for word in ("TX wire", "ACL", "one client id"))
    verdict = rig.goal(FollowJointTrajectoryGoal(trajectory=move(HOME, READY)))
    assert not verdict.accepted
    assert verdict.reason == rig.reason_not_ready
    assert not rig.messages(DEVICE_STATUS)[-1].online
    rig.run(10.0)
    assert rig.state.round_trip_age > 10.0
    rig.lost = set()
    assert rig.run(0.5, lambda: not rig.reason_not_ready)
    assert rig.run(0.1, lambda: rig.state.round_trip_age < 0.1)


def test_a_pause_of_the_gateways_own_loop_is_no_deafness_of_the_device() -> None:
    rig = VirtualArm().ready()
    rig.loop_is_on = False
    rig.run(10.0)
    rig.loop_is_on = True
    rig.run(0.05)
    assert "does not hear" not in rig.reason_not_ready


def test_a_stop_that_is_not_heard_says_what_is_known() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(0.8)
    rig.lost = set(TO_DEVICE)
    rig.ask(StopKind.STOP)
    assert rig.run(COMMAND, lambda: 1 in rig.answers)
    answer = rig.answers[1]
    assert not answer.accepted
    assert "has not answered STOP" in answer.reason
    assert "speaks and does not hear" in answer.reason
    assert "its last state, 0.0 s old: it stands, in mode HOLD" in answer.reason
