"""The page of parol6: six sliders, and a gizmo that turns as well."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, radians

import numpy as np
import pytest

import gemelo
from gemelo.tools.stack.stack import Stack
from tests.panel.person import Person, until
from tests.stacks.shared import found_by_scripts


@pytest.fixture(scope="module")
def twin(parol6_stack: Stack) -> Iterator[Stack]:
    with found_by_scripts(parol6_stack):
        yield parol6_stack


def test_sliders_a_plan_and_execute_bring_six_joints_there(person: Person, arm: gemelo.Arm) -> None:
    first, last = arm.joint_names[0], arm.joint_names[-1]
    person.types(f"{first} [°]", 20)
    person.types(f"{last} [°]", 200)
    person.press("Plan and execute")
    until(lambda: degrees(arm.joints[first]), lambda now: abs(now - 20.0) < 0.1)
    until(lambda: degrees(arm.joints[last]), lambda now: abs(now - 200.0) < 0.1)
    person.reads("Arrived")
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9
    person.tab("Jog")
    assert person.button("rz +").count() == 1


def test_the_tool_s_numbers_lead_the_goal_and_what_is_not_typed_stays(person: Person, arm: gemelo.Arm) -> None:
    place, turn = "Tool x, y, z [mm]", "Roll, pitch, yaw [°]"
    arm.move(named="ready")
    person.press("Goal to where the arm is")
    at, orientation = arm.pose().position, arm.pose().orientation
    until(lambda: person.values(place), lambda now: now == pytest.approx([1000.0 * each for each in at], abs=0.06))
    x, y, z = person.values(place)
    person.fills(place, (x, y, z + 40.0))
    until(lambda: goal_pose(person, arm).position[2], lambda now: abs(now - at[2] - 0.04) < 1e-3)
    assert goal_pose(person, arm).position[:2] == pytest.approx(at[:2], abs=1e-3)
    assert abs(np.dot(goal_pose(person, arm).orientation, orientation)) == pytest.approx(1.0, abs=1e-5)
    roll, pitch, yaw = person.values(turn)
    person.fills(turn, (roll, pitch, yaw + 15.0))
    until(lambda: person.values(turn)[2], lambda now: abs(now - yaw - 15.0) < 0.11)
    raised = pytest.approx((at[0], at[1], at[2] + 0.04), abs=1e-3)
    until(lambda: goal_pose(person, arm).position, lambda now: now == raised)  # the sliders follow one by one
    person.press("Plan and execute")
    until(lambda: arm.pose().position[2], lambda now: abs(now - at[2] - 0.04) < 5e-4)


def goal_pose(person: Person, arm: gemelo.Arm) -> gemelo.Pose:
    """Of the tool [m], with the joint values that the sliders show."""
    return arm.fk({name: radians(person.value(f"{name} [°]")) for name in arm.joint_names})
