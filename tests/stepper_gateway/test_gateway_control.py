"""Control: one holder at a time, others refused by name, and nothing changes hands before the arm rests."""

from __future__ import annotations

import re
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.control import ControlGive, ControlJoin, ControlState, ControlTake
from gemelo.schemas.device import (
    ArmCommand,
    DeviceMode,
    HomeCommand,
    OutputCommand,
    ReferenceCommand,
    ResetCommand,
    ResumeCommand,
    SpeedCommand,
    StopKind,
)
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import CONTROL
from gemelo.services.stepper_gateway.control.control import MOST_MEMBERS
from gemelo.tools.virtual_arm.gateway_driver import CancelInput, ConfigureInput, TargetsInput
from gemelo.tools.virtual_arm.virtual_arm import GatewayParameters, VirtualArm
from tests.profiles import examples
from tests.stepper_gateway.harness import assert_within_limits, move

ZERO = (0.0, 0.0, 0.0)
FAR = (1.2, -1.2, 0.08)
GRACE = GatewayParameters().control_grace


class Client(NamedTuple):
    """A node that asks for control."""

    session: str
    node: str


ANA, BEN = Client("5e55a", "cli-1"), Client("5e55b", "cli-2")
SECRETS = {ANA: "a" * 64, BEN: "b" * 64}
NAMES = {ANA: "ana", BEN: "ben"}
COMMANDS = [
    ResumeCommand(), ResetCommand(), ReferenceCommand(), ArmCommand(), HomeCommand(), OutputCommand(output="avanzar"),
    SpeedCommand(scale=0.5),
]  # fmt: skip


def key_of(who: Client) -> str:
    return f"@id/{who.node}/{1:020d}.{who.node[-1]}.desk-{who.node[-1]}"


def take(who: Client, force: bool = False) -> ControlTake:
    return ControlTake(name=NAMES[who], client=key_of(who), secret=SECRETS[who], force=force)


def held_by_ana(rig: VirtualArm | None = None) -> VirtualArm:
    rig = rig or VirtualArm().ready()
    rig.control(take(ANA), ANA.session)
    assert rig.controlled.pop(1).accepted
    return rig


def state(rig: VirtualArm) -> ControlState:
    found: ControlState = rig.messages(CONTROL)[-1]
    return found


def stands(rig: VirtualArm) -> bool:
    return rig.device.mode not in (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING)


def is_still(rig: VirtualArm) -> bool:
    return rig.path[-1] == rig.path[-2]


def test_without_a_holder_everybody_may_move() -> None:
    rig = VirtualArm().ready()
    assert not state(rig).held
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(0.5)
    assert rig.finish("a")[0] is GoalStatusCode.SUCCEEDED
    assert rig.goal(move(FAR, ZERO), "b", BEN.session).accepted


def test_the_holder_moves_and_others_are_refused_by_name_since_when_and_from_where() -> None:
    rig = held_by_ana()
    rig.run(12.0)
    verdict = rig.goal(move(ZERO, FAR), "b", BEN.session)
    assert not verdict.accepted
    assert verdict.code is FollowErrorCode.NOT_IN_CONTROL
    assert re.fullmatch(
        r"ana holds control of rm1, since \d\d:\d\d:\d\d UTC \(12 s ago\), from node cli-1 on desk-1: "
        r"ask for it, or run `gemelo control take --force`",
        verdict.reason,
    ), verdict.reason
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    assert rig.finish("a")[0] is GoalStatusCode.SUCCEEDED
    assert state(rig).members == ("cli-1",)


@pytest.mark.parametrize("session", ["", "5e55", "5e55a ", "cli-1"])
def test_who_does_not_say_who_it_is_or_says_something_else_is_not_the_holder(session: str) -> None:
    rig = held_by_ana()
    assert rig.goal(move(ZERO, FAR), "b", session).code is FollowErrorCode.NOT_IN_CONTROL


@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: type(each).__name__)
def test_commands_of_others_are_refused_and_never_reach_the_device(command) -> None:
    rig = held_by_ana()
    sent = len(rig.sent)
    rig.ask(command, 7, BEN.session)
    assert "ana holds control of rm1" in rig.answers[7].reason
    assert (rig.answers[7].check, rig.answers[7].sent) == ("control", False)
    assert not [kind for _, kind, _ in rig.sent[sent:] if kind == "cmd"]


def test_the_holders_command_reaches_the_device() -> None:
    rig = held_by_ana()
    rig.ask(SpeedCommand(scale=0.5), 7, ANA.session)
    assert rig.run(1.0, lambda: 7 in rig.answers)
    assert rig.answers[7].accepted


def test_a_configuration_of_others_is_refused_by_name() -> None:
    rig = held_by_ana()
    rig.handle(ConfigureInput(7, BEN.session))
    assert not rig.configured[7].accepted
    assert "ana holds control" in rig.configured[7].reason


@pytest.mark.parametrize("kind", list(StopKind))
def test_stop_hold_and_disarm_are_everybodys(kind: StopKind) -> None:
    rig = held_by_ana()
    if kind is not StopKind.DISARM:
        assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
        rig.run(1.0)
    assert rig.answer(kind).accepted


def test_everybody_may_cancel_the_holders_goal() -> None:
    rig = held_by_ana()
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(1.0)
    assert rig.handle(CancelInput("a")).why is None
    assert rig.finish("a")[0] is GoalStatusCode.CANCELED


def test_streamed_targets_of_others_do_not_move_the_arm_and_are_told_so_once_a_second() -> None:
    rig = held_by_ana()
    for _ in range(75):
        rig.handle(TargetsInput(JointTargets(name=rig.arm.joint_names, position=FAR), BEN.node))
        rig.run(0.02)
    assert rig.position == pytest.approx(ZERO, abs=1e-3)
    refusals = [event for event in rig.published["device/events"] if event.event == "target_refused"]
    assert [event.client for event in refusals] == [BEN.node] * 2
    assert "ana holds control" in refusals[0].detail


def test_targets_of_others_neither_steer_nor_keep_alive_the_holders_stream() -> None:
    rig = held_by_ana()
    for _ in range(50):
        rig.handle(TargetsInput(JointTargets(name=rig.arm.joint_names, position=(0.4, 0.0, 0.0)), ANA.node))
        rig.handle(TargetsInput(JointTargets(name=rig.arm.joint_names, position=(-0.4, 0.0, 0.0)), BEN.node))
        rig.run(0.02)
    assert max(row[0] for row in rig.path) > 0.0
    assert rig.position[0] > 0.0
    silence = GatewayParameters().stream_silence
    for _ in range(round((silence + 1.0) / 0.02)):
        rig.handle(TargetsInput(JointTargets(name=rig.arm.joint_names, position=(-0.4, 0.0, 0.0)), BEN.node))
        rig.run(0.02)
    assert is_still(rig)
    assert rig.position[0] > 0.0


def test_a_gripper_goal_of_others_is_refused_by_name() -> None:
    rig = held_by_ana()
    assert rig.grip(0.0, session=BEN.session).code is FollowErrorCode.NOT_IN_CONTROL
    assert rig.grip(0.0, session=ANA.session).code is not FollowErrorCode.NOT_IN_CONTROL


def test_a_forced_take_leaves_the_jaws_where_they_are_and_ends_their_goal_with_the_reason() -> None:
    rig = held_by_ana()
    assert rig.grip(0.05, session=ANA.session).accepted
    assert rig.finish_grip()[0] is GoalStatusCode.SUCCEEDED
    assert rig.grip(0.0, session=ANA.session).accepted
    rig.run(0.05)
    rig.control(take(BEN, force=True), BEN.session, 2)
    status, result = rig.finish_grip(seconds=0.1)
    assert status is GoalStatusCode.ABORTED
    assert "ben (node cli-2 on desk-2) takes control" in result.error_string
    assert rig.run(1.0, lambda: 2 in rig.controlled)
    assert rig.controlled[2].accepted


def test_a_second_take_is_refused_by_name() -> None:
    rig = held_by_ana()
    rig.control(take(BEN), BEN.session, 2)
    assert not rig.controlled[2].accepted
    assert "ana holds control of rm1" in rig.controlled[2].reason
    assert state(rig).name == "ana"


def test_the_same_take_again_is_answered_as_the_first() -> None:
    rig = held_by_ana()
    number = state(rig).number
    rig.control(take(ANA), ANA.session, 2)
    assert rig.controlled[2].accepted
    assert rig.controlled[2].number == state(rig).number == number


def test_a_forced_take_slows_the_former_holder_to_rest_first_and_says_so_in_the_log() -> None:
    rig = held_by_ana()
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(1.0)
    since = len(rig.path)
    rig.control(take(BEN, force=True), BEN.session, 2)
    assert 2 not in rig.controlled
    assert "nothing moves until the arm rests" in rig.goal(move(ZERO, FAR), "b", BEN.session).reason
    assert rig.goal(move(ZERO, FAR), "c", ANA.session).code is FollowErrorCode.NOT_IN_CONTROL
    assert rig.run(3.0, lambda: 2 in rig.controlled)
    assert rig.controlled[2].accepted
    assert stands(rig)
    assert is_still(rig)
    status, result = rig.finish("a")
    assert status is GoalStatusCode.ABORTED
    assert "ben (node cli-2 on desk-2) takes control" in result.error_string
    assert state(rig).name == "ben"
    assert any("taken it, by force, from ana (node cli-1 on desk-1)" in line for line in rig.log)
    assert "ben holds control" in rig.goal(move(rig.position, ZERO), "d", ANA.session).reason
    assert rig.goal(move(rig.position, ZERO), "e", BEN.session).accepted
    assert rig.finish("e")[0] is GoalStatusCode.SUCCEEDED
    assert_within_limits(rig, since)


def test_a_take_slows_the_motion_of_another_to_rest_also_where_nobody_held_control() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR), "b", BEN.session).accepted
    rig.run(1.0)
    rig.control(take(ANA), ANA.session)
    assert 1 not in rig.controlled
    assert rig.run(3.0, lambda: 1 in rig.controlled)
    assert stands(rig)
    assert rig.finish("b")[0] is GoalStatusCode.ABORTED


def test_a_take_leaves_the_takers_own_motion_alone() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(1.0)
    held_by_ana(rig)
    assert rig.finish("a")[0] is GoalStatusCode.SUCCEEDED


def test_a_take_brings_a_homing_and_a_held_motion_of_others_to_an_end() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR), "b", BEN.session).accepted
    rig.run(1.0)
    assert rig.answer(StopKind.HOLD).accepted
    rig.control(take(ANA), ANA.session)
    assert rig.run(3.0, lambda: 1 in rig.controlled)
    assert stands(rig)
    assert not rig.answer(ResumeCommand()).accepted


def test_a_holder_that_vanishes_loses_control_after_the_stated_time_with_the_arm_at_rest() -> None:
    rig = held_by_ana()
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(1.0)
    began, rested = rig.now, 0.0
    while state(rig).held:
        rig.absences[key_of(ANA)] = rig.now - began
        rig.run(0.02)
        if stands(rig) and not rested:
            rested = rig.now
        if not stands(rig):
            assert state(rig).held, "control was lost before the arm was at rest"
        if state(rig).held:
            assert rig.goal(move(rig.position, ZERO), "b", BEN.session).code is FollowErrorCode.NOT_IN_CONTROL
        assert rig.now - began < GRACE + 0.5
    assert 0.0 < rested - began < GRACE
    assert rig.now - began == pytest.approx(GRACE, abs=0.05)
    assert rig.finish("a")[0] is GoalStatusCode.ABORTED
    assert any("has lost it, gone for" in line for line in rig.log)
    rig.absences.clear()
    assert rig.goal(move(rig.position, ZERO), "c", BEN.session).accepted
    assert rig.finish("c")[0] is GoalStatusCode.SUCCEEDED


def test_control_is_kept_beyond_its_time_while_the_arm_is_not_at_rest() -> None:
    rig = held_by_ana(VirtualArm(parameters=GatewayParameters(control_grace=0.5)).ready())
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(1.0)
    rig.lost = {"cmd"}  # no STOP arrives
    began = rig.now
    while rig.now - began < 1.0:
        rig.absences[key_of(ANA)] = rig.now - began
        rig.run(0.02)
        assert stands(rig) or state(rig).held
    rig.lost = set()
    rig.absences[key_of(ANA)] = 1.5
    assert rig.run(3.0, lambda: not state(rig).held)
    assert stands(rig)


def test_a_frozen_holder_that_wakes_in_time_keeps_control_but_not_its_motion() -> None:
    rig = held_by_ana()
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted
    rig.run(1.0)
    rig.absences[key_of(ANA)] = 1.0
    rig.run(1.0)
    assert "is gone for" in rig.goal(move(rig.position, ZERO), "b", ANA.session).reason
    rig.absences.clear()
    rig.run(0.1)
    assert rig.finish("a")[0] is GoalStatusCode.ABORTED
    assert state(rig).name == "ana"
    assert any("ana (node cli-1 on desk-1) is back" in line for line in rig.log)
    assert rig.goal(move(rig.position, ZERO), "c", ANA.session).accepted


def test_a_frozen_holder_that_wakes_too_late_finds_another_holder_and_cannot_give_that_ones_control_back() -> None:
    rig = held_by_ana()
    rig.absences[key_of(ANA)] = GRACE + 1.0
    rig.run(0.1)
    rig.control(take(BEN), BEN.session, 2)
    assert rig.controlled[2].accepted
    rig.absences.clear()
    rig.run(0.1)
    assert "ben holds control" in rig.goal(move(ZERO, FAR), "a", ANA.session).reason
    rig.control(ControlGive(secret=SECRETS[ANA]), ANA.session, 3)
    assert "ben (node cli-2 on desk-2) holds control, not you" in rig.controlled[3].reason
    rig.control(ControlJoin(client=key_of(ANA), secret=SECRETS[ANA]), ANA.session, 4)
    assert not rig.controlled[4].accepted
    assert state(rig).members == ("cli-2",)


@pytest.mark.parametrize(
    ("principal", "address"), [("operator.desk", "operator.desk/cli-1"), ("local", "cli-1"), ("panel", "panel")]
)
def test_a_stream_is_the_holders_by_the_address_in_its_key(principal: str, address: str) -> None:
    """Behind the lock two people may have nodes of one name."""
    rig = VirtualArm().ready()
    node = address.rpartition("/")[2]
    token = f"@id/{principal}/{node}/{1:020d}.1.desk"
    rig.control(ControlTake(name="ana", client=token, secret=SECRETS[ANA]), ANA.session)
    rig.run(0.1)
    assert state(rig).members == (address,)
    targets = JointTargets(name=rig.arm.joint_names, position=(0.1, 0.0, 0.0))
    for stranger in {node, "operator.lab/cli-1", "operator.lab/panel", "local/cli-1"} - {address}:
        for _ in range(10):
            rig.handle(TargetsInput(targets, stranger))
            rig.run(0.02)
        assert rig.position == ZERO, stranger
    rig.handle(TargetsInput(targets, address))
    rig.run(0.3)
    assert rig.position != ZERO


def test_given_back_everybody_may_move() -> None:
    rig = held_by_ana()
    rig.control(ControlGive(secret=SECRETS[ANA]), "any", 2)
    assert rig.controlled[2].accepted
    assert not state(rig).held
    assert rig.goal(move(ZERO, FAR), "b", BEN.session).accepted


def test_a_node_that_knows_the_secret_moves_the_arm_until_it_ends() -> None:
    rig = held_by_ana()
    script = Client("5e55c", "pick-3")
    rig.control(ControlJoin(client=key_of(script), secret=SECRETS[ANA]), script.session, 2)
    assert rig.controlled[2].accepted
    assert rig.goal(move(ZERO, FAR), "c", script.session).accepted
    assert state(rig).members == ("cli-1", "pick-3") or rig.run(0.1)
    rig.absences[key_of(script)] = GRACE + 0.1
    rig.run(0.1)
    assert state(rig).members == ("cli-1",)
    assert rig.goal(move(ZERO, FAR), "d", script.session).code is FollowErrorCode.NOT_IN_CONTROL


def test_a_wrong_secret_neither_joins_nor_gives() -> None:
    rig = held_by_ana()
    for ticket, request in enumerate(
        (ControlJoin(client=key_of(BEN), secret=SECRETS[BEN]), ControlGive(secret=SECRETS[BEN])), 2
    ):
        rig.control(request, BEN.session, ticket)
        assert not rig.controlled[ticket].accepted
        assert "holds control, not you" in rig.controlled[ticket].reason
    assert state(rig).held


def test_no_more_nodes_than_so_many_share_a_hold() -> None:
    rig = held_by_ana()
    for number in range(MOST_MEMBERS + 2):
        node = f"s-{number}"
        request = ControlJoin(client=f"@id/{node}/{1:020d}.1.desk", secret=SECRETS[ANA])
        rig.control(request, f"{number:x}", 100 + number)
    accepted = [rig.controlled[100 + number].accepted for number in range(MOST_MEMBERS + 2)]
    assert accepted == [True] * (MOST_MEMBERS - 1) + [False] * 3
    assert len(state(rig).members) == MOST_MEMBERS


def test_a_restarted_gateway_knows_no_holder_and_an_earlier_epochs_secret_opens_nothing() -> None:
    rig = held_by_ana()
    epoch = state(rig).epoch
    rig.new_gateway()
    rig.ready()
    assert not state(rig).held
    assert state(rig).epoch != epoch
    rig.control(ControlJoin(client=key_of(ANA), secret=SECRETS[ANA]), ANA.session, 2)
    assert "nobody holds control" in rig.controlled[2].reason
    rig.control(ControlGive(secret=SECRETS[ANA]), ANA.session, 3)
    assert not rig.controlled[3].accepted
    assert rig.goal(move(ZERO, FAR), "b", BEN.session).accepted


def test_a_claimant_that_ends_before_the_arm_rests_does_not_get_control() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR), "b", BEN.session).accepted
    rig.run(1.0)
    rig.control(take(ANA), ANA.session)
    rig.absences[key_of(ANA)] = 0.5
    rig.run(0.05)
    assert not rig.controlled[1].accepted
    assert not state(rig).held
    rig.run(3.0)
    assert rig.goal(move(rig.position, ZERO), "c", BEN.session).accepted


def test_of_two_that_force_at_once_the_later_gets_it_and_the_earlier_hears_so() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR), "c", "5e55c").accepted
    rig.run(1.0)
    rig.control(take(ANA), ANA.session, 1)
    rig.control(take(BEN), BEN.session, 2)
    assert "ana (node cli-1 on desk-1) is taking control" in rig.controlled[2].reason
    rig.control(take(BEN, force=True), BEN.session, 3)
    assert "ben (node cli-2 on desk-2) has asked for control after you" in rig.controlled[1].reason
    assert rig.run(3.0, lambda: 3 in rig.controlled)
    assert rig.controlled[3].accepted


def test_control_is_lost_and_taken_also_while_the_device_cannot_be_reached() -> None:
    rig = held_by_ana()
    rig.device_is_on = False
    rig.absences[key_of(ANA)] = GRACE + 1.0
    assert rig.run(2.0, lambda: not state(rig).held)
    rig.control(take(BEN), BEN.session, 2)
    assert rig.controlled[2].accepted


KEYS = [
    "", "@id", "@id/cli-2/1.2.desk", "@id/*/00000000000000000001.2.desk", "@id/cli-2/**", "@alive/cli-2",
    "@id/CLI/00000000000000000001.2.desk", "@id/cli-2/00000000000000000001.2.desk/more",
    "@id/cli-2/00000000000000000001.2.d*sk", "@id/cli-2/00000000000000000001.2.desk\n",
    "@id/" + "a" * 500 + "/00000000000000000001.2.desk", "x" * 100_000,
]  # fmt: skip


@pytest.mark.parametrize("key", KEYS, ids=range(len(KEYS)))
def test_a_client_that_is_no_nodes_token_gets_nothing_and_is_never_watched(key: str) -> None:
    rig = VirtualArm().ready()
    rig.control(ControlTake(name="ben", client=key, secret=SECRETS[BEN]), BEN.session)
    assert "is not the key of a liveliness token" in rig.controlled[1].reason
    assert len(rig.controlled[1].reason) < 300
    assert rig.core.watched_clients == ()
    assert rig.goal(move(ZERO, FAR), "a", ANA.session).accepted


@pytest.mark.parametrize("name", ["", " ", "a" * 41, "a" * 100_000, "ana\nERROR", "\x1b[2J", "\0", "a\u202eb"])
def test_a_name_that_cannot_be_read_is_refused(name: str) -> None:
    rig = VirtualArm().ready()
    rig.control(ControlTake(name=name, client=key_of(BEN), secret=SECRETS[BEN]), BEN.session)
    assert "is no name" in rig.controlled[1].reason
    assert rig.controlled[1].reason.isprintable()
    assert not state(rig).held


@pytest.mark.parametrize("secret", ["", "short", "x" * 129, "x" * 1_000_000])
def test_a_secret_that_can_be_guessed_or_is_huge_is_refused(secret: str) -> None:
    rig = VirtualArm().ready()
    for request in (ControlTake(name="ben", client=key_of(BEN), secret=secret), ControlGive(secret=secret)):
        rig.control(request, BEN.session)
        assert "32 to 128 are needed" in rig.controlled[1].reason


def test_the_secret_is_in_nothing_that_the_gateway_says() -> None:
    rig = held_by_ana()
    rig.control(ControlJoin(client=key_of(BEN), secret=SECRETS[ANA]), BEN.session, 2)
    rig.control(ControlJoin(client=key_of(BEN), secret="z" * 64), BEN.session, 3)
    rig.run(0.2)
    said = repr((rig.published, rig.controlled, rig.log, rig.answers))
    assert SECRETS[ANA] not in said
    assert "z" * 64 not in said


def test_who_has_taken_and_lost_control_stands_in_the_log_with_its_level() -> None:
    rig = held_by_ana()
    rig.control(take(BEN, force=True), BEN.session, 2)
    levels = {text: level for level, text in zip(rig.levels, rig.log, strict=True) if text.startswith("control: ")}
    assert levels == {
        "control: ana (node cli-1 on desk-1) has taken it": LogLevel.INFO,
        "control: ben (node cli-2 on desk-2) has taken it, by force, from ana (node cli-1 on desk-1)": LogLevel.WARNING,
    }


CALLERS = st.sampled_from([ANA, BEN])
STEPS = st.lists(
    st.tuples(st.sampled_from(["take", "force", "give", "join", "goal", "gone", "back", "run", "stop"]), CALLERS),
    max_size=25,
)


@examples(quick=10, full=40)
@given(STEPS)
def test_whatever_is_asked_in_whatever_order_only_the_holder_moves_and_the_arm_is_never_blocked(steps) -> None:
    rig = VirtualArm().ready()
    for number, (what, who) in enumerate(steps, 1):
        match what:
            case "take" | "force":
                rig.control(take(who, what == "force"), who.session, number)
            case "give":
                rig.control(ControlGive(secret=SECRETS[who]), who.session, number)
            case "join":
                rig.control(ControlJoin(client=key_of(who), secret=SECRETS[ANA]), who.session, number)
            case "goal":
                end = ZERO if max(map(abs, rig.position)) > 0.1 else FAR
                verdict = rig.goal(move(rig.position, end), f"g{number}", who.session)
                if verdict.accepted and state(rig).held:
                    assert who.node in state(rig).members
            case "gone":
                rig.absences[key_of(who)] = GRACE + 1.0
            case "back":
                rig.absences.pop(key_of(who), None)
            case "stop":
                rig.ask(StopKind.STOP, number)
            case "run":
                rig.run(0.3)
    rig.run(2.0)
    rig.absences.clear()
    rig.control(take(BEN, force=True), BEN.session, 1000)
    assert rig.run(5.0, lambda: 1000 in rig.controlled)
    assert rig.controlled[1000].accepted
    assert state(rig).name == "ben"
    assert rig.goal(move(rig.position, ZERO), "last", BEN.session).accepted
    assert rig.finish("last")[0] is GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)
