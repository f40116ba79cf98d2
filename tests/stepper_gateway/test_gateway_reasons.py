"""The reasons of the gateway: real causes in virtual time, each with its code and its values."""

from __future__ import annotations

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.control import ControlGive, ControlJoin, ControlTake
from gemelo.schemas.device import (
    HomeCommand,
    OutputCommand,
    ReferenceCommand,
    ResetCommand,
    SpeedCommand,
    StopKind,
)
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTolerance
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.topics import CONTROL, DEVICE_CONFIGURATION, DEVICE_EVENTS, DEVICE_STATUS, STEP_LEDGER
from gemelo.services.stepper_gateway.links.link import TO_DEVICE
from gemelo.services.stepper_gateway.links.serial_port import complaint, open_port
from gemelo.tools.virtual_arm.gateway_driver import CancelInput, GatewayDriver
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.text_arm import TextArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import move

HOME, FAR = (0.0, 0.0, 0.0), (1.2, -1.2, 0.08)
JOINTS = rm1().joint_names


def refused(arm: VirtualArm) -> Reason:
    """Why a goal is refused now, which is what the device's status says too, and its sentence in the old field."""
    verdict = arm.goal(move(HOME, FAR), "refused")
    assert not verdict.accepted
    assert verdict.why is not None
    assert verdict.reason == str(verdict.why)
    arm.run(0.1)
    status = arm.messages(DEVICE_STATUS)[-1]
    assert status.why == verdict.why
    assert status.reason == str(status.why)
    return verdict.why


def ended(arm: GatewayDriver, goal_id: str = "g") -> Reason:
    """Why a goal has ended, whose sentence is in the old field."""
    status, result = arm.finish(goal_id)
    assert status is not GoalStatusCode.SUCCEEDED
    assert result.why is not None
    assert result.error_string == str(result.why)
    return result.why


def moving(arm: ArmDescription | None = None) -> VirtualArm:
    rig = VirtualArm(arm).ready() if arm is not None else VirtualArm().ready()
    assert rig.goal(move(HOME, FAR)).accepted
    rig.run(1.0)
    return rig


def test_a_device_that_is_not_ready_says_what_it_needs() -> None:
    arm = VirtualArm(referenced=False)
    arm.run(3.0)
    mend = remedy("home_or_reference" if all(joint.drive.homing for joint in rm1().joints) else "reference_by_hand")
    assert refused(arm) == because("device.unreferenced", mend, device="rm1", joints=JOINTS)
    assert arm.answer(StopKind.DISARM).accepted
    assert refused(arm) == because("device.disarmed", mend, device="rm1")


def test_an_emergency_stop_ends_the_goal_and_refuses_the_next_with_its_input() -> None:
    arm = moving()
    arm.device.press_input(0, True)
    pressed = because("device.estop.pressed", remedy("release_and_reset"), device="rm1", input="estop")
    assert ended(arm) == pressed
    assert refused(arm) == pressed
    arm.device.press_input(0, False)
    arm.run(0.5)
    assert refused(arm) == because("device.estop.was_pressed", remedy("reset_and_reference"), device="rm1")


def test_a_silent_device_a_deaf_one_and_a_cut_link_are_three_reasons() -> None:
    arm = VirtualArm().ready()
    arm.lost = set(TO_DEVICE)
    arm.run(3.0)
    assert refused(arm) == because("device.deaf", device="rm1")
    arm = VirtualArm().ready()
    arm.lost = {"state"}
    arm.run(3.0)
    silent = arm.goal(move(HOME, FAR), "refused").why
    assert silent == because("device.silent", device="rm1", time=arm.core.device.parameters.state_timeout)


def test_how_a_goal_ended_is_a_code() -> None:
    arm = moving()
    assert arm.handle(CancelInput("g")).why is None
    assert ended(arm) == because("ending.canceled")
    assert arm.handle(CancelInput("g")).why == because("goal.not_under_way", goal="g")
    arm = moving()
    arm.ask(StopKind.STOP)
    assert ended(arm) == because("ending.command", command="STOP")
    arm = moving()
    arm.answer(StopKind.HOLD)
    arm.reboot(7)
    assert ended(arm) == because("device.restarted")


def test_a_goal_that_is_too_strict_is_ended_with_joint_error_and_bound() -> None:
    arm = VirtualArm().ready()
    strict = (JointTolerance(name=JOINTS[0], position=1e-9),)
    goal = FollowJointTrajectoryGoal(trajectory=move(HOME, FAR), path_tolerance=strict)
    assert arm.goal(goal).accepted
    reason = ended(arm)
    assert reason.code == "ending.off_path"
    assert reason.values["joint"] == JOINTS[0]
    error, bound = reason.values["error"], reason.values["bound"]
    assert isinstance(error, float)
    assert isinstance(bound, float)
    assert abs(error) > bound > 0.0
    assert 0.0 < float(reason.values["time"]) < 1.0  # type: ignore[arg-type]


def test_what_was_to_follow_ends_for_the_reason_of_the_goal_before_it() -> None:
    arm = moving()
    assert arm.goal(FollowJointTrajectoryGoal(trajectory=move(FAR, HOME), after="g"), "next").accepted
    arm.ask(StopKind.STOP)
    stopped = because("ending.command", command="STOP")
    assert ended(arm, "next") == because("ending.before_it", stopped, goal="g", status="ABORTED")


def test_a_command_that_is_refused_says_by_whom_and_what_would_do() -> None:
    arm = VirtualArm().ready()
    refusals = {
        HomeCommand(name=("nobody",)): "goal.joints.unknown",
        OutputCommand(output="nothing"): "command.output.unknown",
        SpeedCommand(scale=1.5): "command.speed.range",
        ReferenceCommand(name=(JOINTS[0],), position=(99.0,)): "goal.limit.position",
        ReferenceCommand(name=JOINTS[:2], position=(0.0,)): "command.positions.count",
    }
    for command, code in refusals.items():
        answer = arm.answer(command)
        assert answer.why is not None
        assert (answer.why.code, answer.reason) == (code, str(answer.why))
    arm = moving()
    assert arm.answer(HomeCommand()).why == because("command.goal_active", command="HOME")
    arm.answer(StopKind.HOLD)
    refusal = arm.answer(ResetCommand()).why
    assert refusal is None or refusal.code.startswith("command.refused")


def test_control_is_refused_with_the_holder_and_lost_claims_with_theirs() -> None:
    arm = VirtualArm().ready()
    keys = {name: f"@id/cli-{name}/{1:020d}.7.desk" for name in ("ana", "ben")}
    take = {name: ControlTake(name=name, client=keys[name], secret=name * 20) for name in keys}
    arm.control(take["ana"], "s-ana")
    assert arm.controlled.pop(1).why is None
    arm.control(take["ben"], "s-ben")
    held = arm.controlled.pop(1)
    assert held.why is not None
    assert (held.why.code, held.reason) == ("control.held", str(held.why))
    assert {**held.why.values, "clock": ""} == {
        "robot": "rm1", "clock": "", "age": held.why.values["age"], "name": "ana", "node": "cli-ana", "host": "desk",
    }  # fmt: skip
    verdict = arm.goal(move(HOME, FAR), "b", "s-ben")
    assert verdict.why is not None
    assert verdict.why.code == "control.held"
    others = {"name": "ana", "node": "cli-ana", "host": "desk"}
    arm.control(ControlGive(secret="b" * 40), "s-ben")
    assert arm.controlled.pop(1).why == because("control.give.others", **others)
    arm.control(ControlJoin(client=keys["ben"], secret="b" * 40), "s-ben")
    assert arm.controlled.pop(1).why == because("control.join.others", **others)
    arm.absences = {keys["ana"]: 0.5}
    arm.run(0.1)
    state = arm.messages(CONTROL)[-1]
    assert state.why == because("control.holder_gone", **others)
    assert state.pending == str(state.why)


def test_a_target_that_is_refused_says_why_in_its_event() -> None:
    arm = moving()
    arm.target(**{JOINTS[0]: 0.1})
    event = arm.messages(DEVICE_EVENTS)[-1]
    assert event.event == "target_refused"
    assert event.why == because("target.goal_active")
    assert event.detail == str(event.why)


def test_the_step_ledger_says_what_makes_it_least_sure() -> None:
    arm = VirtualArm().ready()
    assert arm.answer(ReferenceCommand()).accepted
    arm.run(1.0)
    ledger = arm.messages(STEP_LEDGER)[-1]
    assert ledger.why.code.startswith("ledger.doubt.")
    assert ledger.why.values["joint"] == ledger.doubtful
    assert ledger.why.values["by"] == "reference"
    assert ledger.reason == str(ledger.why)


def test_another_configuration_is_named_with_both_sums() -> None:
    arm = VirtualArm().ready()
    configuration = arm.messages(DEVICE_CONFIGURATION)[-1]
    assert configuration.why is None
    before = [each for each in arm.messages(DEVICE_CONFIGURATION) if each.why is not None]
    assert [each.reason for each in before] == [str(each.why) for each in before]
    assert before


def test_a_board_that_answers_no_line_is_a_reason_within_that_of_the_link() -> None:
    arm = TextArm()
    arm.answers_lines = False
    arm.referenced()
    assert arm.run(3.0, lambda: arm.messages(DEVICE_STATUS)[-1].why is not None)
    why = arm.messages(DEVICE_STATUS)[-1].why
    assert why.code == "device.no_link"
    assert [cause.code for cause in why.causes] == ["link.board_silent"]


def test_a_sketch_that_fell_silent_in_a_message_has_lost_its_position() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(move(HOME, (0.5, 0.0, 0.0), arm=arm.arm)).accepted
    assert arm.run(20.0, lambda: abs(arm.sketch.motors[0].remaining) > 200)
    arm.sketch.restart(1.1)
    why = ended(arm)
    assert why.code == "ending.ended_not_verified"
    assert [cause.code for cause in why.causes] == ["position.sketch_silent"]
    lost = next(event for event in arm.messages(DEVICE_EVENTS) if event.event == "position_lost")
    assert lost.why.code == "position.sketch_silent"
    assert lost.detail == str(lost.why)


def test_a_port_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(OSError, match="ttyNONE") as error:
        open_port("/dev/ttyNONE", 115_200)
    why = complaint("/dev/ttyNONE", error.value)
    assert (why.code, why.values) == ("link.port.absent", {"port": "/dev/ttyNONE"})
    assert [each.code for each in why.remedies] in (["other_ports"], ["no_ports"], ["ports_unseen"])


def test_a_command_that_is_not_answered_says_how_often_it_was_sent_and_a_stop_how_the_arm_was() -> None:
    arm = VirtualArm().ready()
    arm.lost = {"cmd/ack"}
    arm.ask(ResetCommand(), 7)
    assert arm.run(3.0, lambda: 7 in arm.answers)
    unanswered = arm.answers.pop(7).why
    assert unanswered is not None
    count = unanswered.values["count"]
    assert isinstance(count, int)
    assert count > 1
    assert unanswered == because("command.unanswered", command="RESET", count=count)
    arm.ask(StopKind.STOP, 8)
    assert arm.run(3.0, lambda: 8 in arm.answers)
    last = arm.answers.pop(8).why
    assert last is not None
    assert (last.code, last.values["mode"]) == ("command.last_state.stands", "IDLE")
    assert [cause.code for cause in last.causes] == ["command.unanswered"]


def test_nothing_begins_while_a_command_is_under_way() -> None:
    arm = VirtualArm().ready()
    arm.lost = {"cmd/ack"}
    arm.ask(StopKind.DISARM)
    assert arm.goal(move(HOME, FAR), "refused").why == because("command.under_way", command="DISARM")


def test_a_device_that_loses_the_heartbeat_ends_the_goal_by_its_own_word() -> None:
    arm = moving()
    arm.lost = {"hb"}
    assert ended(arm) == because("ending.held.heartbeat")


def test_a_velocity_that_is_off_is_given_in_the_unit_of_the_joint() -> None:
    arm = VirtualArm().ready()
    strict = (JointTolerance(name=JOINTS[0], position=-1.0, velocity=1e-9),)
    assert arm.goal(FollowJointTrajectoryGoal(trajectory=move(HOME, FAR), path_tolerance=strict)).accepted
    reason = ended(arm)
    assert (reason.code, reason.values["joint"], reason.values["unit"]) == ("ending.off_velocity", JOINTS[0], "rad")


def test_a_stream_that_was_interrupted_waits_for_a_silence() -> None:
    arm = VirtualArm().ready()
    for _ in range(10):
        arm.target(**{JOINTS[0]: 0.2})
        arm.run(0.05)
    arm.ask(StopKind.STOP)
    for _ in range(60):  # it goes on, and is refused again and again
        arm.run(0.05)
        arm.target(**{JOINTS[0]: 0.2})
    refusals = [event.why for event in arm.messages(DEVICE_EVENTS) if event.event == "target_refused"]
    interrupted = because("target.interrupted", time=arm.core.device.parameters.stream_silence)
    counted = [why for why in refusals if why.code == "target.and_more"]  # sent once a second at most
    assert counted
    assert all(why.causes == (interrupted,) and why.values["count"] > 10 for why in counted)
