"""A stop gets through whatever is not known of the device, whatever is unanswered, and however often it is said."""

from __future__ import annotations

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, InjectKind, InjectRequest, SpeedCommand, StopKind
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.device.pending_commands import MOST_TICKETS, MOST_UNDER_WAY, PendingCommands
from gemelo.services.stepper_gateway.links.frames import CommandFrame, decode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.tools.virtual_arm.gateway_driver import ConfigureInput, InjectInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import assert_within_limits, move

ZERO = (0.0, 0.0, 0.0)
FAR = (1.2, -1.2, 0.08)


def moving() -> VirtualArm:
    """A rig whose arm is in the middle of a goal."""
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.0)
    assert rig.device.mode == DeviceMode.RUN
    return rig


def restarted(*lost: Kind) -> VirtualArm:
    """A rig whose gateway has restarted in the middle of a move, and hears nothing of these kinds."""
    rig = moving()
    rig.lost = set(lost)
    rig.new_gateway()
    rig.run(0.1)
    assert rig.device.mode == DeviceMode.RUN
    return rig


def commands(rig: VirtualArm) -> list[CommandFrame]:
    frames = [decode(payload) for _, kind, payload in rig.sent if kind == Kind.CMD]
    return [frame for frame in frames if isinstance(frame, CommandFrame)]


def stands(rig: VirtualArm) -> bool:
    return rig.device.mode not in (DeviceMode.RUN, DeviceMode.HOLD)


@pytest.mark.parametrize(
    ("lost", "unknown"),
    [
        ((Kind.SYNC_R,), "the clock of device"),
        ((Kind.STATUS,), "has not said yet who it is"),
        ((Kind.STATUS, Kind.SYNC_R), "has not said yet who it is"),
        ((Kind.STATE, Kind.STATUS), "has not been heard"),
    ],
)
def test_a_stop_needs_neither_clock_nor_status_nor_boot_and_says_afterwards_what_is_not_known(
    lost: tuple[Kind, ...], unknown: str
) -> None:
    rig = restarted(*lost)
    before = rig.now
    rig.ask(StopKind.STOP, 7)
    assert rig.run(0.05, lambda: 7 in rig.answers)
    assert rig.answers[7].accepted
    assert unknown in rig.answers[7].reason
    assert rig.run(2.0, lambda: stands(rig))
    assert next(at for at, kind, _ in rig.sent if kind == Kind.CMD and at >= before) == before
    assert_within_limits(rig)


def test_a_hold_without_a_clock_stands_on_the_path() -> None:
    rig = restarted(Kind.SYNC_R)
    rig.ask(StopKind.HOLD, 7)
    assert rig.run(0.05, lambda: 7 in rig.answers)
    assert rig.answers[7].accepted
    assert rig.device.mode == DeviceMode.HOLD


def test_a_stop_that_comes_late_by_a_wrong_clock_is_sent_again_without_one() -> None:
    rig = moving()
    for _ in range(64):  # the machine has slept: its clock stands behind what the exchanges have said
        rig.core.device.session.clock.add(0, 1, 1, 100)
    rig.ask(StopKind.STOP, 7)
    assert rig.run(0.1, lambda: 7 in rig.answers)
    assert rig.answers[7].accepted
    assert rig.run(2.0, lambda: stands(rig))


def test_a_stop_reaches_a_boot_that_the_gateway_has_not_met_yet() -> None:
    rig = moving()
    rig.lost = {Kind.STATE, Kind.STATUS}
    rig.reboot(99)
    rig.ask(StopKind.STOP, 7)
    assert rig.run(0.1, lambda: 7 in rig.answers)
    assert rig.answers[7].accepted


def test_a_stop_leaves_at_once_with_a_configuration_and_twenty_presses_unanswered() -> None:
    rig = moving()
    rig.lost = {Kind.CONFIG, Kind.INJECT}
    rig.handle(ConfigureInput(500))
    for number in range(20):
        rig.handle(InjectInput(1000 + number, InjectRequest(kind=InjectKind.ESTOP)))
    before = rig.now
    rig.ask(StopKind.STOP, 7)
    assert [at for at, kind, _ in rig.sent if kind == Kind.CMD] == [before]
    assert rig.run(0.1, lambda: 7 in rig.answers)
    assert rig.finish()[0] == GoalStatusCode.ABORTED


def test_repeated_stops_cost_one_frame_and_are_all_answered() -> None:
    rig = moving()
    for ticket in range(1, 201):
        rig.ask(StopKind.STOP, ticket)
    assert len(commands(rig)) == 1
    assert rig.run(0.1, lambda: len(rig.answers) == 200)
    assert all(answer.accepted for answer in rig.answers.values())
    assert rig.finish()[0] == GoalStatusCode.ABORTED


def test_more_callers_of_a_stop_than_one_frame_serves_cost_few_frames() -> None:
    commands, moment = PendingCommands(1), Moment(0, 0.0)
    for ticket in range(1, 4 * MOST_TICKETS + 1):
        commands.ask(DeviceCommandKind.STOP, moment, 2.0, ticket)
    assert len(commands.due(moment, ClockSync(), 1, is_reachable=False)) == 4
    assert sum(len(command.tickets) for command in commands.expired(Moment(0, 3.0))) == 4 * MOST_TICKETS


def test_a_stop_of_a_later_motion_is_not_taken_for_the_earlier_one() -> None:
    rig = moving()
    rig.ask(StopKind.STOP, 1)
    assert rig.finish()[0] == GoalStatusCode.ABORTED
    assert rig.goal(move(rig.position, ZERO), "h").accepted
    rig.run(0.5)
    rig.ask(StopKind.STOP, 2)
    assert rig.finish("h")[0] == GoalStatusCode.ABORTED
    assert len({frame.cmd_id for frame in commands(rig)}) == 2


def test_a_stop_to_a_silent_device_says_that_it_was_sent_and_nothing_more() -> None:
    rig = moving()
    rig.device_is_on = False
    rig.ask(StopKind.STOP, 7)
    assert rig.run(3.0, lambda: 7 in rig.answers)
    assert not rig.answers[7].accepted
    assert rig.answers[7].sent
    assert "has not answered STOP in time" in rig.answers[7].reason
    assert "silent" in rig.answers[7].reason


def test_a_stop_without_a_link_says_that_it_could_not_be_sent() -> None:
    rig = moving()
    rig.link(False)
    rig.ask(StopKind.STOP, 7)
    assert rig.run(3.0, lambda: 7 in rig.answers)
    assert not rig.answers[7].sent
    assert "the device holds by itself" in rig.answers[7].reason


def test_a_stop_asked_for_without_a_link_leaves_with_the_link() -> None:
    rig = moving()
    rig.link(False)
    rig.ask(StopKind.STOP, 7)
    rig.run(0.3)
    rig.link(True)
    assert rig.run(0.1, lambda: 7 in rig.answers)
    assert rig.answers[7].accepted


def test_disarm_is_refused_while_a_goal_moves_the_arm() -> None:
    rig = moving()
    rig.ask(StopKind.DISARM, 7)
    assert "cancel it or run `gemelo stop` before DISARM" in rig.answers[7].reason
    assert not commands(rig)


def test_a_flood_of_commands_is_bounded_and_a_stop_goes_before_it() -> None:
    rig = moving()
    rig.lost = {Kind.CMD_ACK}
    for ticket in range(1, 1001):
        rig.ask(SpeedCommand(scale=1.0), ticket)
    assert len(commands(rig)) == MOST_UNDER_WAY
    assert "has not answered the commands before this one yet" in rig.answers[1000].reason
    rig.ask(StopKind.STOP, 2000)
    assert commands(rig)[-1].cmd == DeviceCommandKind.STOP
    assert rig.run(2.0, lambda: stands(rig))


def test_a_stop_that_is_asked_for_again_while_the_device_is_silent_is_sent_again_at_once() -> None:
    rig = moving()
    rig.device_is_on = False
    rig.ask(StopKind.STOP, 7)
    rig.run(0.03)
    sent = len(commands(rig))
    rig.ask(StopKind.STOP, 8)
    assert len(commands(rig)) == sent + 1


def test_a_stop_that_is_asked_for_just_after_the_gateways_own_is_sent_at_once_too() -> None:
    rig = moving()
    rig.device_is_on = False
    rig.ask(StopKind.STOP, 7)
    sent = len(commands(rig))
    assert rig.run(0.2, lambda: len(commands(rig)) > sent)  # it is repeated until answered
    sent = len(commands(rig))
    rig.ask(StopKind.STOP, 8)
    assert len(commands(rig)) == sent + 1
    for ticket in range(9, 200):
        rig.ask(StopKind.STOP, ticket)
    assert len(commands(rig)) <= sent + 4
    rig.run(0.03)
    assert len(commands(rig)) <= sent + 6
