"""Dialect "text" in virtual time: a board at rest stays at rest, and one that answers nothing is named as such."""

from __future__ import annotations

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.tools.virtual_arm.gateway_driver import EchoInput
from gemelo.tools.virtual_arm.text_arm import TRIP, TextArm
from gemelo.tools.virtual_arm.virtual_arm import UNIX
from tests.stepper_gateway.harness import move

HOME = (0.0, 0.0, 0.0)
END = (0.3, -0.2, 0.01)


def text_move(arm: TextArm):
    return move(HOME, END, arm=arm.arm)


def test_an_arm_at_rest_is_not_stopped() -> None:
    arm = TextArm().referenced()
    arm.run(12.0)
    assert len(arm.lines) > 5, "the questions for the clock are lines"
    assert {line for _, line in arm.lines} == {HOME}
    modes = {state.mode for state in arm.published["device/state"] if all(state.referenced)}
    assert modes == {DeviceMode.IDLE}
    assert "stopping" not in arm.events()
    assert "hold" not in arm.events()


@pytest.mark.parametrize("pause", [0.0, 0.03, 0.1, 0.5])
def test_a_move_right_after_the_reference_is_taken(pause: float) -> None:
    arm = TextArm().referenced()
    arm.run(pause)
    verdict = arm.goal(text_move(arm))
    assert verdict.accepted, verdict.reason
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    assert arm.lines[-1][1] == pytest.approx(END, abs=0.01)


def test_a_goal_ends_when_its_last_line_is_acknowledged_and_not_before() -> None:
    arm = TextArm(trip=0.2).referenced()
    assert arm.goal(text_move(arm)).accepted
    arm.finish()
    last = next(time for time, line in arm.lines if line == arm.lines[-1][1])
    assert arm.now >= last + 0.2


def test_a_board_that_never_answers_is_offline_with_what_to_look_at_and_the_reference_does_not_hide_it() -> None:
    arm = TextArm()
    arm.answers_lines = False
    arm.referenced()
    assert arm.run(3.0, lambda: not arm.published["device/status"][-1].online)
    for number in range(3):
        reason = arm.published["device/status"][-1].reason
        assert "no line was answered" in reason
        assert "115200 baud" in reason
        arm.command(DeviceCommandKind.REFERENCE, number)
        arm.run(1.5)
        assert not arm.published["device/status"][-1].online
    assert "no line was answered" in arm.goal(text_move(arm)).reason


def test_a_board_that_answers_at_last_is_there_again() -> None:
    arm = TextArm()
    arm.answers_lines = False
    arm.referenced()
    assert arm.run(3.0, lambda: not arm.published["device/status"][-1].online)
    arm.answers_lines = True
    assert arm.run(3.0, lambda: not arm.reason_not_ready), arm.reason_not_ready
    assert arm.goal(text_move(arm)).accepted
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED


def test_a_move_of_a_board_that_falls_mute_ends_with_what_is_known() -> None:
    arm = TextArm().referenced()
    assert arm.goal(text_move(arm)).accepted
    arm.run(0.5)
    arm.answers_lines = False
    status, result = arm.finish()
    assert status is GoalStatusCode.ABORTED
    assert "no line was answered" in result.error_string
    assert "restarted" not in result.error_string
    assert "rebooted" not in arm.events()
    assert "position_lost" in arm.events()


def test_after_a_loss_a_new_reference_does_not_hide_that_the_board_is_still_mute() -> None:
    arm = TextArm().referenced()
    assert arm.goal(text_move(arm)).accepted
    arm.run(0.5)
    arm.answers_lines = False
    arm.finish()
    lines = len(arm.lines)
    arm.run(2.0)
    assert len(arm.lines) == lines, "nothing is sent to a board that is not known to stand where it should"
    arm.command(DeviceCommandKind.REFERENCE, 2)
    arm.run(1.0)
    assert "no line was answered" in arm.published["device/status"][-1].reason


def test_a_process_that_was_stopped_does_not_take_the_board_for_silent() -> None:
    arm = TextArm().referenced()
    assert arm.goal(text_move(arm)).accepted
    arm.run(0.5)
    arm.answers_lines = False
    arm.run(0.1)
    arm.now += 2.0  # nothing was read meanwhile
    arm.answers_lines = True
    arm.run(1.0)
    assert "position_lost" not in arm.events()


def test_what_a_line_takes_is_reported_without_the_waiting_for_it() -> None:
    """At 25 Hz every question waits for the next line: 37 ms were shown for a wire that takes 9."""
    arm = TextArm().referenced()
    arm.run(1.0)
    for ticket in range(50):
        arm.handle(EchoInput(ticket))
        arm.run(0.04)
    trips = [arm.echoed[ticket] for ticket in range(50) if ticket in arm.echoed]
    assert len(trips) > 45
    assert all(each.round_trip == pytest.approx(TRIP, abs=0.0015) for each in trips)
    assert max(each.waiting for each in trips) > 0.01
    assert arm.state.round_trip == pytest.approx(TRIP, abs=0.0015)


def test_the_clock_of_the_board_is_not_shifted_by_the_waiting() -> None:
    arm = TextArm().referenced()
    assert arm.goal(text_move(arm)).accepted
    arm.finish()
    for state in arm.published["device/state"][-50:]:
        assert state.stamp - UNIX == pytest.approx(1000 * state.device_time, abs=1e6), "by a millisecond at most"
