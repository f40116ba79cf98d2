"""Inverse kinematics: within limits, exact, nearest first, and the same every time."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER, Deadline
from tests.profiles import examples

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
KINEMATICS = Kinematics(ARM)
IK = InverseKinematics(ARM, KINEMATICS)
CONFIGURATIONS = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in ARM.joints])


@examples(full=300)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_fk_of_ik_is_the_goal(goal: tuple[float, ...], near: tuple[float, ...]):
    target = ToolTarget(KINEMATICS.tool(goal).position)
    solution = next(IK.solutions(target, np.array(near), NEVER))
    assert np.linalg.norm(KINEMATICS.tool(solution).position - target.position) < 1e-6
    assert all(joint.is_within(value) for joint, value in zip(ARM.joints, solution.tolist(), strict=True))


def test_both_elbows_are_found_and_the_nearer_one_comes_first():
    target = ToolTarget(np.array([0.25, 0.15, 0.1]))
    for side in (-1.0, 1.0):
        near = np.array([0.5 - side, 1.8 * side, 0.08])
        first, second = islice(IK.solutions(target, near, NEVER), 2)
        assert np.sign(first[1]) == side
        assert np.sign(second[1]) == -side


@examples(quick=25)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_the_nearest_comes_first_of_all_that_are_found(goal: tuple[float, ...], near: tuple[float, ...]):
    start, target = np.array(near), ToolTarget(KINEMATICS.tool(goal).position)
    if IK.descend(target, start).is_solution:  # else the arm is stuck there, and comes from elsewhere
        travels = [IK.travel(start, solution) for solution in IK.solutions(target, start, NEVER)]
        assert travels[0] <= min(travels) + 0.02  # the stretched arm's two elbows are one


def test_it_is_deterministic():
    target, near = ToolTarget(np.array([0.1, -0.25, 0.05])), np.zeros(3)
    again = [list(IK.solutions(target, near, NEVER)) for _ in range(2)]
    assert np.array_equal(again[0], again[1])


def test_the_way_inwards_from_the_stretched_arm_is_found():
    """Stretched, the Jacobian has no column along the arm: one start would stay there."""
    tool = KINEMATICS.tool((0.0, 0.0, 0.0)).position
    assert next(IK.solutions(ToolTarget(0.7 * tool + [0.0, 0.0, 0.05]), np.zeros(3), NEVER)) is not None


def test_out_of_reach_gives_no_solution_but_the_nearest_configuration():
    target = ToolTarget(np.array([0.6, 0.0, 0.1]))
    assert list(IK.solutions(target, np.zeros(3), NEVER)) == []
    best = IK.nearest(target, np.zeros(3), NEVER)[0]
    assert KINEMATICS.tool(best).position == pytest.approx((0.4063, 0.0, 0.1), abs=1e-3)


def test_a_search_that_is_late_ends():
    assert list(IK.solutions(ToolTarget(np.array([0.6, 0.0, 0.1])), np.zeros(3), Deadline(allowed=0.0))) == []


@examples(quick=15, full=50)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_orientations_are_met_where_the_arm_can(goal: tuple[float, ...], near: tuple[float, ...]):
    pose = KINEMATICS.tool(goal)
    solution = next(IK.solutions(ToolTarget(pose.position, pose.rotation), np.array(near), NEVER))
    assert np.allclose(KINEMATICS.tool(solution).rotation, pose.rotation, atol=1e-5)
