"""Arming, homing, outputs and speed, as a person asks for them, with the real core and its motors and switches."""

from __future__ import annotations

from dataclasses import replace as with_

import msgspec
import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import (
    DeviceCommand,
    DeviceCommandKind,
    DeviceCommandResponse,
    DeviceFault,
    DeviceMode,
    HomeCommand,
    OutputCommand,
    SpeedCommand,
)
from gemelo.schemas.message import BadMessage, decode
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.gateway_driver import asked
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import ROOT, assert_within_limits, move

ARM, DISARM, HOME = DeviceCommandKind.ARM, DeviceCommandKind.DISARM, DeviceCommandKind.HOME
OUTPUT, SPEED, RESET, STOP = (
    DeviceCommandKind.OUTPUT, DeviceCommandKind.SPEED, DeviceCommandKind.RESET, DeviceCommandKind.STOP,
)  # fmt: skip
ZERO = (0.0, 0.0, 0.0)
NEAR = (0.1, -0.2, 0.01)
FAR = (0.6, -1.2, 0.08)


def ask(
    rig: VirtualArm, kind: DeviceCommandKind, *names: str, output: str = "", value: float = 0.0
) -> DeviceCommandResponse:
    return rig.answer(asked(kind, name=names, output=output, on=value > 0.0, scale=value))


def done(rig: VirtualArm, kind: DeviceCommandKind, *names: str, output: str = "", value: float = 0.0) -> None:
    answer = ask(rig, kind, *names, output=output, value=value)
    assert answer.accepted, answer.reason


def reason_of(rig: VirtualArm, goal_id: str) -> str:
    verdict = rig.goal(move(ZERO, NEAR), goal_id)
    assert not verdict.accepted
    return verdict.reason


def test_an_arm_that_starts_disarmed_is_armed_homed_and_moves() -> None:
    rig = VirtualArm(config=replace(device_config(rm1()), armed_at_boot=True), referenced=False).ready()
    assert "gemelo home" in reason_of(rig, "unreferenced")
    assert "brazo_joint, antebrazo_joint, efector_joint" in reason_of(rig, "which")
    done(rig, DISARM)
    assert "gemelo device arm" in reason_of(rig, "disarmed")
    assert not rig.state.armed
    assert "gemelo device arm" in ask(rig, HOME).reason
    done(rig, ARM)
    rig.run(0.3)
    assert rig.state.armed
    done(rig, HOME)
    assert rig.state.mode == DeviceMode.HOMING
    assert "home switches" in reason_of(rig, "homing")
    assert rig.run(90.0, lambda: rig.device.mode == DeviceMode.IDLE)
    rig.run(0.1)
    assert rig.state.referenced == (True, True, True)
    assert rig.events().count("homed") == 3
    assert rig.messages(JOINT_STATES)[-1].position == pytest.approx((-2.9, -2.9, 0.194), abs=0.016)
    assert all(abs(counted - true) <= 1 for counted, true in zip(rig.device.steps, rig.device.shaft, strict=True))
    goal = move(rig.messages(JOINT_STATES)[-1].position, (-2.5, -2.5, 0.15))
    since = len(rig.path)
    assert rig.goal(goal, "after").accepted
    assert rig.finish("after")[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig, since)


def test_homing_one_joint_leaves_the_others_where_they_are() -> None:
    rig = VirtualArm().ready()
    done(rig, HOME, "efector_joint")
    assert rig.run(60.0, lambda: rig.device.mode == DeviceMode.IDLE)
    assert rig.device.steps[:2] == (0, 0)
    assert rig.device.steps[2] > 0


def test_homing_tells_how_many_steps_a_joint_was_off() -> None:
    rig = VirtualArm().ready()
    rig.device.slip(2, 40)
    done(rig, HOME, "efector_joint")
    assert rig.run(60.0, lambda: rig.device.mode == DeviceMode.IDLE)
    rig.run(0.1)
    (homed,) = [event.detail for event in rig.published["device/events"] if event.event == "homed"]
    assert homed.startswith("q3")
    assert "40" in homed
    assert rig.device.steps == rig.device.shaft


def test_a_lost_heartbeat_stops_the_homing() -> None:
    rig = VirtualArm(referenced=False).ready()
    done(rig, HOME)
    rig.run(3.0)
    rig.lost.add(Kind.HB)
    rig.run(2.0)
    assert rig.device.mode == DeviceMode.UNREFERENCED
    assert not rig.device.moving
    assert ("homing_stopped", "heartbeat") in [(e.event, e.detail) for e in rig.published["device/events"]]


def test_a_beating_gateway_lets_a_long_homing_end() -> None:
    rig = VirtualArm(referenced=False).ready()
    begun = rig.now
    done(rig, HOME)
    assert rig.run(90.0, lambda: rig.device.mode == DeviceMode.IDLE)
    assert rig.now - begun > 10.0


def test_a_person_stops_a_homing() -> None:
    rig = VirtualArm(referenced=False).ready()
    done(rig, HOME)
    rig.run(2.0)
    done(rig, STOP)
    assert rig.run(2.0, lambda: rig.device.mode == DeviceMode.UNREFERENCED)


def test_a_running_goal_is_not_disturbed_by_what_wants_a_resting_arm() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.0)
    for kind in (HOME, DISARM, DeviceCommandKind.REFERENCE):
        answer = ask(rig, kind)
        assert not answer.accepted
        assert "gemelo stop" in answer.reason
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


def test_an_estop_ends_the_goal_and_says_the_way_back() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.0)
    rig.device.press_input(0, True)
    status, result = rig.finish(seconds=1.0)
    assert status == GoalStatusCode.ABORTED
    assert "emergency stop" in result.error_string
    rig.run(0.1)
    assert (rig.state.mode, rig.state.fault, rig.state.armed) == (DeviceMode.ESTOP, DeviceFault.EMERGENCY_STOP, False)
    assert rig.state.inputs == ("estop",)
    assert '"estop"' in reason_of(rig, "pressed")
    assert "release it" in ask(rig, RESET).reason
    assert not ask(rig, ARM).accepted
    rig.device.press_input(0, None)
    rig.run(0.1)
    assert "was pressed" in reason_of(rig, "released")
    done(rig, RESET)
    done(rig, ARM)
    rig.run(0.3)
    done(rig, HOME, "efector_joint")


def test_a_limit_switch_outside_homing_is_a_fault_that_names_the_joint() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.0)
    rig.device.press_input(2, True)
    status, result = rig.finish(seconds=1.0)
    assert status == GoalStatusCode.ABORTED
    assert "antebrazo_joint" in result.error_string
    assert "gemelo reset" in result.error_string
    rig.run(0.1)
    assert (rig.state.fault, rig.state.fault_joint) == (DeviceFault.LIMIT_SWITCH, "antebrazo_joint")


def test_an_output_goes_on_and_off_by_its_name() -> None:
    rig = VirtualArm().ready()
    done(rig, OUTPUT, output="avanzar", value=1.0)
    assert rig.state.outputs == rig.device.outputs == ("avanzar",)
    done(rig, OUTPUT, output="avanzar", value=0.0)
    assert rig.state.outputs == ()
    assert 'did you mean "avanzar"' in ask(rig, OUTPUT, output="avansar", value=1.0).reason
    half_on = msgspec.msgpack.encode({"type": "output", "output": "avanzar", "on": 0.5})
    with pytest.raises(BadMessage, match="`bool`, got `float`"):
        decode(OutputCommand, half_on)


def test_an_output_does_not_disturb_a_goal() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.0)
    done(rig, OUTPUT, output="avanzar", value=1.0)
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (HomeCommand(name=("braso_joint",)), ("braso_joint", "brazo_joint")),
        (SpeedCommand(scale=1.2), ("0 (stands) to 1", "1.2")),
        (SpeedCommand(scale=-0.1), ("0 (stands) to 1",)),
    ],
)
def test_a_command_that_names_or_asks_what_is_not_there_is_refused(
    request_: DeviceCommand, words: tuple[str, ...]
) -> None:
    rig = VirtualArm().ready()
    reason = rig.answer(request_).reason
    assert all(word in reason for word in words)
    assert not [kind for _, kind, _ in rig.sent if kind == Kind.CMD]


def test_a_joint_without_a_home_switch_is_named() -> None:
    arm = rm1()
    first = with_(arm.joints[0], drive=replace(arm.joints[0].drive, homing=None))
    rig = VirtualArm(arm=with_(arm, joints=(first, *arm.joints[1:]))).ready()
    reason = ask(rig, HOME, "brazo_joint").reason
    assert "brazo_joint" in reason
    assert "gemelo reference" in reason
    done(rig, HOME)
    assert rig.run(90.0, lambda: rig.device.mode == DeviceMode.IDLE)
    assert rig.device.steps[0] == 0


@pytest.mark.parametrize("speed", [0.05, 0.3, 0.7])
def test_a_slow_goal_takes_its_time_and_succeeds_to_the_step(speed: float) -> None:
    rig = VirtualArm().ready()
    done(rig, SPEED, value=speed)
    assert rig.state.speed == speed
    begun = rig.now
    goal = move(ZERO, NEAR)
    assert rig.goal(goal).accepted
    status, result = rig.finish(seconds=120.0)
    assert status == GoalStatusCode.SUCCEEDED, result.error_string
    assert rig.now - begun >= goal.points[-1].time_from_start / speed
    assert result.executed_steps == (297, -13, 28)
    assert_within_limits(rig)


def test_a_speed_of_zero_stands_on_the_path_for_any_time() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.2)
    done(rig, SPEED, value=0.0)
    rig.run(60.0)
    assert not rig.finished
    assert rig.device.mode == DeviceMode.RUN
    elapsed = [feedback.elapsed for feedback in rig.feedback[-20:]]
    assert max(elapsed) - min(elapsed) < 1e-9
    done(rig, SPEED, value=1.0)
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)


def test_the_speed_may_change_again_and_again_on_the_way() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(ZERO, FAR)).accepted
    for index, speed in enumerate((0.2, 0.9, 0.1, 0.5, 1.0, 0.4)):
        rig.run(0.7)
        rig.ask(SpeedCommand(scale=speed), index)
    status, result = rig.finish(seconds=120.0)
    assert status == GoalStatusCode.SUCCEEDED, result.error_string
    assert_within_limits(rig)


def test_starving_at_a_low_speed_is_no_excuse() -> None:
    rig = VirtualArm().ready()
    done(rig, SPEED, value=0.5)
    assert rig.goal(move(ZERO, FAR)).accepted
    rig.run(1.0)
    rig.lost.add(Kind.TRAJ)
    status, _ = rig.finish(seconds=40.0)
    assert status == GoalStatusCode.ABORTED


def test_a_goal_right_after_arming_waits_for_the_drivers() -> None:
    rig = VirtualArm()
    assert rig.run(1.0, lambda: not rig.core.not_ready(rig.moment))
    assert rig.now < 0.2, "the drivers need 0.2 s"
    assert rig.goal(move(ZERO, NEAR)).accepted
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)


def test_parol6_lifts_its_forearm_before_it_turns() -> None:
    rig = VirtualArm(arm=load_arm(ROOT / "urdf" / "parol6"), referenced=False).ready()
    done(rig, HOME)
    assert rig.run(90.0, lambda: rig.device.mode == DeviceMode.IDLE)
    rig.run(0.1)
    order = [event.detail for event in rig.published["device/events"] if event.event == "homed"]
    assert order[:3] == ["J3", "J2", "J1"]
    assert set(order[3:]) == {"J4", "J5", "J6"}
    assert all(rig.state.referenced)
    assert all(abs(counted - true) <= 1 for counted, true in zip(rig.device.steps, rig.device.shaft, strict=True))
