"""The closed form of parol6: complete, exact, within limits, and gone without a word too many where it cannot be."""

from __future__ import annotations

import dataclasses
import logging
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.services.planner.kinematics.closed_form import closed_form, turns_about
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER
from tests.profiles import examples

ROOT = Path(__file__).parents[2] / "urdf"
PAROL6 = load_arm(ROOT / "parol6")
KINEMATICS = Kinematics(PAROL6)
IK = InverseKinematics(PAROL6, KINEMATICS)
SEARCHED = InverseKinematics(PAROL6, KINEMATICS, is_numeric=True)
READY = np.array(PAROL6.named_states["ready"])
CONFIGURATIONS = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in PAROL6.joints])
UNIT = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


def with_limits(arm: ArmDescription, name: str, lower: float, upper: float) -> ArmDescription:
    """The same arm, one joint of which has other limits."""
    joints = [dataclasses.replace(j, lower=lower, upper=upper) if j.name == name else j for j in arm.joints]
    return dataclasses.replace(arm, joints=tuple(joints))


def test_parol6_has_one_and_rm1_does_not():
    assert IK.is_closed_form
    rm1 = load_arm(ROOT / "rm1")
    assert closed_form(rm1, Kinematics(rm1)) is None


@examples(full=300)
@given(CONFIGURATIONS)
def test_the_configuration_that_a_pose_was_made_of_is_among_the_solutions(goal: tuple[float, ...]):
    pose = KINEMATICS.tool(goal)
    solutions = list(IK.solutions(ToolTarget(pose.position, pose.rotation), READY, NEVER))
    assert solutions
    if abs(goal[4]) > 1e-3:  # else the wrist is straight, and joint_4 and joint_6 share one turn
        assert min(np.abs(solution - goal).max() for solution in solutions) < 1e-5


@examples(quick=25)
@given(CONFIGURATIONS)
def test_an_arm_with_a_straight_wrist_that_is_there_already_stays_there(configuration: tuple[float, ...]):
    """joint_4 and joint_6 then turn about one axis, and only their sum is given."""
    here = np.array((*configuration[:4], 0.0, configuration[5]))
    pose = KINEMATICS.tool(here)
    first = next(IK.solutions(ToolTarget(pose.position, pose.rotation), here, NEVER))
    assert IK.travel(here, first) < 1e-4


def test_every_full_turn_within_the_limits_is_a_solution_of_its_own():
    arm = with_limits(PAROL6, "joint_6", -2.0 * math.tau, 2.0 * math.tau)
    inverse = InverseKinematics(arm, KINEMATICS)
    pose = KINEMATICS.tool(READY)
    solutions = list(inverse.solutions(ToolTarget(pose.position, pose.rotation), READY, NEVER))
    wrists = sorted(round(float(q[5] - READY[5]) / math.tau, 6) for q in solutions if np.allclose(q[:5], READY[:5]))
    present = READY[5] / math.tau
    assert wrists == [turn for turn in range(-4, 5) if -2.0 <= turn + present <= 2.0]


def test_a_joint_without_limits_takes_the_turn_nearest_to_where_it_is():
    arm = with_limits(PAROL6, "joint_6", -math.inf, math.inf)
    pose = KINEMATICS.tool(READY)
    near = READY + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3.0 * math.tau])
    first = next(InverseKinematics(arm, KINEMATICS).solutions(ToolTarget(pose.position, pose.rotation), near, NEVER))
    assert np.allclose(first, near)


def test_the_order_of_the_joints_in_robot_toml_does_not_matter():
    arm = dataclasses.replace(PAROL6, joints=PAROL6.joints[::-1])
    kinematics = Kinematics(arm)
    inverse = InverseKinematics(arm, kinematics)
    assert inverse.is_closed_form
    pose = kinematics.tool(READY[::-1])
    assert np.allclose(
        next(inverse.solutions(ToolTarget(pose.position, pose.rotation), READY[::-1], NEVER)), READY[::-1]
    )


@examples(quick=8, full=20)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_searching_finds_no_nearer_configuration_than_the_closed_form(goal: tuple[float, ...], near: tuple[float, ...]):
    pose = KINEMATICS.tool(goal)
    target, start = ToolTarget(pose.position, pose.rotation), np.array(near)
    first = next(IK.solutions(target, start, NEVER))
    searched = list(SEARCHED.solutions(target, start, NEVER))
    if abs(goal[4]) > 1e-3 and searched:
        assert IK.travel(start, first) <= min(IK.travel(start, q) for q in searched) + 1e-4


def test_without_eaik_the_arm_is_searched_and_the_log_says_so_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setitem(sys.modules, "eaik.pybindings.EAIK", None)
    with caplog.at_level(logging.WARNING):
        inverse = InverseKinematics(PAROL6, KINEMATICS)
    assert not inverse.is_closed_form
    assert [record.getMessage()[:44] for record in caplog.records] == ["no inverse kinematics in closed form, it is "]
    pose = KINEMATICS.tool(READY)
    found = next(inverse.solutions(ToolTarget(pose.position, pose.rotation), READY, NEVER))
    assert np.allclose(KINEMATICS.tool(found).position, pose.position, atol=1e-6)


@given(UNIT, UNIT, CONFIGURATIONS)
def test_turns_about_a_direction_all_point_along_it(
    direction: np.ndarray, axis: np.ndarray, configuration: tuple[float, ...]
):
    direction, axis = direction / np.linalg.norm(direction), axis / np.linalg.norm(axis)
    turns = turns_about(direction, axis, KINEMATICS.tool(configuration).rotation, 5)
    for turn in turns:
        assert np.allclose(turn @ axis, direction)
        assert np.allclose(turn @ turn.T, np.eye(3))
        assert np.linalg.det(turn) == pytest.approx(1.0)
