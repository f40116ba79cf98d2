"""A device that stands still as a whole and wakes up: it catches nothing up, and nothing moves after an abort."""

from __future__ import annotations

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.topics import DEVICE_STATE, JOINT_STATES
from gemelo.services.stepper_gateway.links.frames import CommandFrame, decode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import assert_within_limits, move

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)
TWO_SLOTS = 2 * 4666 / 1000 + 1  # [steps] at the fastest joint's speed


def most(before: tuple[int, ...], after: tuple[int, ...]) -> int:
    return max(abs(a - b) for a, b in zip(after, before, strict=True))


@pytest.mark.parametrize("seconds", [0.7, 2.9, 20.0])
def test_a_device_that_was_frozen_in_a_move_stands_when_it_wakes_up(seconds: float) -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    before = rig.device.steps
    rig.freeze(seconds)
    status, result = rig.finished["g"]
    assert status == GoalStatusCode.ABORTED
    assert "silent" in result.error_string
    awake = rig.device.steps
    assert most(before, awake) <= TWO_SLOTS
    rig.run(5.0)
    assert most(awake, rig.device.steps) <= TWO_SLOTS
    assert rig.device.mode == DeviceMode.IDLE
    assert "late" in rig.events()
    assert "resumed" not in rig.events()
    assert rig.goal(move(rig.messages(JOINT_STATES)[-1].position, HOME), "next").accepted
    assert rig.finish("next")[0] == GoalStatusCode.SUCCEEDED


def test_a_short_freeze_pauses_the_move_on_its_path() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    rig.freeze(0.2)
    since = len(rig.path)
    rig.run(0.01)
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert "late" in rig.events()
    assert_within_limits(rig, since + 5)


@pytest.mark.parametrize("seconds", [0.2, 2.9])
def test_the_first_state_after_a_stand_reports_no_speed(seconds: float) -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    assert max(map(abs, rig.state.velocity)) > 500.0
    known = len(rig.messages(DEVICE_STATE))
    rig.freeze(seconds)
    rig.run(0.1)
    first = rig.messages(DEVICE_STATE)[known]
    assert set(first.velocity) == {0.0}
    assert first.time_scale == 0.0


def test_a_goal_that_was_aborted_before_the_frozen_device_read_it_moves_nothing() -> None:
    rig = VirtualArm().ready()
    rig.device_is_frozen = True
    rig.run(0.3)
    assert rig.goal(move(HOME, READY)).accepted
    rig.freeze(0.4)
    assert rig.finished["g"][0] == GoalStatusCode.ABORTED
    rig.run(3.0)
    assert rig.device.mode == DeviceMode.IDLE
    assert rig.device.steps == (0, 0, 0)


def test_a_device_that_is_lost_in_a_move_finds_a_stop_on_the_wire() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    rig.device_is_frozen = True
    assert rig.run(3.0, lambda: "g" in rig.finished)
    since = len(rig.sent)
    rig.run(0.5)
    late = [decode(payload) for _, kind, payload in rig.sent[since - 1 :] if kind == Kind.CMD]
    assert [frame.cmd for frame in late if isinstance(frame, CommandFrame)].count(DeviceCommandKind.STOP) == 1
