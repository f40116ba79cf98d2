"""The gripper's action on the real firmware core, in virtual time: a measured servo, and a valve that is not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.firmware.bindings.injection import InjectRefused, inject
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.gripper import opening_of, pulse_of
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, InjectKind, InjectRequest, OutputCommand, StopKind
from gemelo.schemas.gripper import GripperCommandGoal, GripperState
from gemelo.schemas.grippers.servo import ServoGripper
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import GRIPPER_STATE
from gemelo.tools.virtual_arm.gateway_driver import GripCancelInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.profiles import examples

ROOT = Path(__file__).resolve().parents[2]
OPEN, VALVE_OPEN = 0.05, 0.04  # [m] of urdf/rm1 and urdf/parol6
SUCCEEDED, ABORTED, CANCELED = GoalStatusCode.SUCCEEDED, GoalStatusCode.ABORTED, GoalStatusCode.CANCELED


def servo() -> ServoGripper:
    gripper = rm1().gripper
    assert isinstance(gripper, ServoGripper)
    return gripper


def unmeasured() -> ArmDescription:
    """rm1 whose servo has no wire of its potentiometer."""
    return replace(rm1(), gripper=msgspec.structs.replace(servo(), sensor=""))


def valve_arm() -> VirtualArm:
    return VirtualArm(arm=load_arm(ROOT / "urdf/parol6")).ready()


def opened() -> VirtualArm:
    """rm1, its jaws commanded open."""
    arm = VirtualArm().ready()
    assert arm.grip(OPEN).accepted
    assert arm.finish_grip()[1].reached_goal
    return arm


def latest(arm: VirtualArm) -> GripperState:
    state: GripperState = arm.messages(GRIPPER_STATE)[-1]
    return state


def test_a_servo_closes_and_opens_at_its_speed_and_says_where_it_is():
    arm = opened()
    begun = arm.now
    assert arm.grip(0.0).accepted
    status, result = arm.finish_grip()
    assert (status, result.reached_goal, result.stalled, result.measured) == (SUCCEEDED, True, False, True)
    assert abs(result.position) <= servo().tolerance
    assert OPEN / servo().speed <= arm.now - begun <= OPEN / servo().speed + 0.3
    arm.run(0.3)
    assert arm.device.opening == pytest.approx(0.0, abs=1e-4)
    assert arm.grip(0.025).accepted
    assert arm.finish_grip()[1].position == pytest.approx(0.025, abs=servo().tolerance)


def test_a_gripper_that_is_there_already_is_there_and_not_stalled():
    arm = VirtualArm().ready()
    for _ in range(2):
        assert arm.grip(OPEN).accepted
        status, result = arm.finish_grip()
        assert (status, result.reached_goal, result.stalled) == (SUCCEEDED, True, False)


def test_a_slow_gripper_is_not_taken_for_a_stalled_one():
    slow = replace(rm1(), gripper=msgspec.structs.replace(servo(), speed=0.0006))
    arm = VirtualArm(arm=slow).ready()
    arm.grip(OPEN)
    arm.finish_grip()
    assert arm.grip(OPEN - 0.006).accepted
    status, result = arm.finish_grip(seconds=30.0)
    assert (status, result.reached_goal, result.stalled) == (SUCCEEDED, True, False)


def test_feedback_tells_ten_times_a_second_how_far_it_is():
    arm = opened()
    arm.gripping.clear()
    arm.grip(0.0)
    arm.finish_grip()
    openings = [told.position for told in arm.gripping]
    assert 4 <= len(openings) <= 8
    assert openings == sorted(openings, reverse=True)


def test_an_object_between_the_jaws_stops_them_and_is_held():
    arm = opened()
    assert arm.device.put_object(0.03)
    arm.grip(0.0)
    status, result = arm.finish_grip()
    assert (status, result.stalled, result.reached_goal) == (SUCCEEDED, True, False)
    assert result.position == pytest.approx(0.03, abs=1e-3)
    assert result.effort == servo().effort
    arm.run(0.2)
    assert latest(arm).stalled
    assert latest(arm).effort == servo().effort
    arm.grip(OPEN)
    assert arm.finish_grip()[1].reached_goal
    arm.run(0.2)
    assert not latest(arm).stalled
    assert latest(arm).effort == 0.0


def test_an_object_is_put_between_the_jaws_by_an_injection_and_only_where_it_fits():
    arm = opened()
    inject(arm.device, InjectRequest(kind=InjectKind.OBJECT, value=0.02))
    arm.grip(0.0)
    assert arm.finish_grip()[1].stalled
    with pytest.raises(InjectRefused, match=r"40 mm do not fit between the jaws, 20\.0 mm apart"):
        inject(arm.device, InjectRequest(kind=InjectKind.OBJECT, value=0.04))
    inject(arm.device, InjectRequest(kind=InjectKind.OBJECT, value=0.0))
    assert arm.grip(0.0, goal_id="again").accepted
    assert arm.finish_grip("again")[1].reached_goal
    with pytest.raises(InjectRefused, match="no servo gripper"):
        inject(valve_arm().device, InjectRequest(kind=InjectKind.OBJECT, value=0.01))


@pytest.mark.parametrize("stop", [StopKind.STOP, StopKind.HOLD])
def test_a_stop_in_the_middle_lets_the_jaws_stay_where_they_are(stop: StopKind):
    arm = opened()
    arm.grip(0.0)
    arm.run(0.25)
    arm.ask(stop)
    status, result = arm.finish_grip()
    arm.run(0.2)
    there = arm.device.opening
    assert status is ABORTED
    assert f"({stop.name})" in result.error_string
    assert 0.015 < there < 0.04
    arm.run(1.0)
    assert arm.device.opening == there
    assert arm.grip(0.0).accepted, "and it moves again when it is asked to"
    assert arm.finish_grip()[1].reached_goal


def test_a_cancel_lets_the_jaws_stay_where_they_are():
    arm = opened()
    arm.grip(0.0)
    arm.run(0.25)
    assert arm.handle(GripCancelInput("grip")).why is None
    status, _ = arm.finish_grip()
    arm.run(0.2)
    there = arm.device.opening
    assert status is CANCELED
    arm.run(1.0)
    assert 0.015 < there < 0.04
    assert arm.device.opening == there
    assert arm.handle(GripCancelInput("grip")).why == because("goal.not_under_way", goal="grip")


def test_a_newer_goal_takes_over():
    arm = opened()
    arm.grip(0.0, goal_id="old")
    arm.run(0.2)
    assert arm.grip(OPEN, goal_id="new").accepted
    assert arm.finish_grip("old")[0] is GoalStatusCode.PREEMPTED
    assert arm.finish_grip("new")[1].reached_goal


@pytest.mark.parametrize("position", [-0.001, 0.0501, 25.0])
def test_an_opening_that_it_cannot_have_is_refused_with_its_limits(position: float):
    arm = opened()
    verdict = arm.grip(position)
    assert not verdict.accepted
    assert f"{position * 1000:g} mm is not between its 0 mm closed and 50 mm open" in verdict.reason
    assert arm.device.opening == pytest.approx(OPEN)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_goal_that_is_not_finite_cannot_even_be_said(value: float):
    for field in ("position", "max_effort"):
        with pytest.raises(ValueError, match="finite"):
            GripperCommandGoal(**{field: value})


def test_a_force_that_it_cannot_keep_to_is_refused_with_the_force_that_it_has():
    arm = opened()
    assert "presses with 11 N and cannot be told to press with at most 5 N" in arm.grip(0.0, 5.0).reason
    assert "write 0 for no bound" in arm.grip(0.0, -1.0).reason
    assert arm.grip(0.0, 11.0).accepted


def test_an_arm_without_a_gripper_says_what_it_lacks():
    arm = VirtualArm(arm=replace(rm1(), gripper=None)).ready()
    assert arm.grip(0.0).reason == "rm1 has no gripper: write a [gripper] into its robot.toml"
    arm.run(1.0)
    assert arm.messages(GRIPPER_STATE) == []


def test_an_emergency_stop_ends_the_goal_and_keeps_the_hold():
    arm = opened()
    arm.grip(0.0)
    arm.run(0.25)
    arm.device.press_input(0, True)
    status, result = arm.finish_grip()
    assert status is ABORTED
    assert "emergency stop" in result.error_string
    arm.run(0.1)
    there = arm.device.opening
    assert arm.device.servo_us > 0, "it holds what it has"
    arm.run(1.0)
    assert arm.device.opening == there
    assert "release it and run `gemelo reset`" in arm.grip(OPEN).reason


def test_a_device_that_falls_silent_ends_the_goal():
    arm = opened()
    arm.grip(0.0)
    arm.run(0.1)
    arm.link(False)
    status, _ = arm.finish_grip()
    assert status is ABORTED
    arm.run(1.0)
    assert not arm.grip(0.0).accepted


def test_a_servo_without_a_sensor_is_there_when_its_pulse_is_and_does_not_claim_more():
    arm = VirtualArm(arm=unmeasured()).ready()
    arm.run(0.2)
    assert not latest(arm).known, "nothing was commanded and nothing is measured"
    begun = arm.now
    assert arm.grip(0.0).accepted
    status, result = arm.finish_grip()
    assert (status, result.reached_goal, result.measured) == (SUCCEEDED, True, False)
    assert arm.now - begun >= OPEN / servo().speed - 1e-6, "the first pulse may find it anywhere"
    arm.device.put_object(0.03)
    assert arm.device.opening == pytest.approx(0.0, abs=1e-3)


def test_a_valve_closes_and_opens_within_its_travel_time():
    arm = valve_arm()
    arm.run(0.2)
    assert latest(arm).known
    assert latest(arm).position == VALVE_OPEN
    for position in (0.0, VALVE_OPEN, 0.0):
        begun = arm.now
        assert arm.grip(position).accepted
        status, result = arm.finish_grip()
        assert (status, result.reached_goal, result.measured) == (SUCCEEDED, True, False)
        assert result.position == position
        assert 0.3 <= arm.now - begun <= 0.55
        assert arm.device.outputs == (("gripper_valve",) if position == 0.0 else ())
    assert latest(arm).effort == 40.0


def test_a_valve_knows_no_half_way():
    assert "knows only closed, 0 mm, and open, 40 mm" in valve_arm().grip(0.005).reason


def test_a_valve_that_somebody_else_switches_ends_the_goal():
    arm = valve_arm()
    arm.grip(0.0)
    arm.run(0.08)
    arm.ask(OutputCommand(output="gripper_valve", on=False))
    status, result = arm.finish_grip()
    assert status is ABORTED
    assert "switched by somebody else" in result.error_string


def test_a_valve_is_left_as_it_is_by_a_stop():
    arm = valve_arm()
    arm.grip(0.0)
    arm.run(0.08)
    arm.ask(StopKind.STOP)
    assert arm.finish_grip()[0] is ABORTED
    arm.run(0.5)
    assert arm.device.outputs == ("gripper_valve",)


def test_the_arm_moves_on_while_the_gripper_works():
    arm = opened()
    before = len(arm.log)
    arm.grip(0.0)
    arm.target(brazo_joint=0.1)
    assert arm.finish_grip()[1].reached_goal
    assert arm.position[0] > 0.0
    assert not [line for line in arm.log[before:] if "refuse" in line]


def test_a_goal_is_judged_before_the_arm_is_referenced_too():
    arm = VirtualArm(referenced=False)
    arm.run(0.5)
    assert arm.grip(0.0).accepted
    assert arm.finish_grip()[1].reached_goal


def test_the_servo_command_has_its_number_of_the_wire():
    assert DeviceCommandKind.SERVO == 12


@examples(quick=15, full=50)
@given(st.floats(0.0, OPEN))
def test_an_opening_is_a_pulse_and_back(opening: float):
    assert opening_of(servo().drive, pulse_of(servo().drive, opening)) == pytest.approx(opening, abs=1e-12)
