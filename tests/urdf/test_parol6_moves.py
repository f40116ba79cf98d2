"""parol6 moves: every named state from every other, and poses in six dimensions, without touching itself."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import Joint, load_arm
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, NamedGoal, PlanCode, PlanRequest, PoseGoal
from gemelo.services.planner.core import Planner
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER
from gemelo.services.planner.timing.profile import joint_limits
from gemelo.services.planner.verification.verify import require_within_limits, sample
from tests.profiles import examples

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "parol6")
PLANNER = Planner(ARM)
CONFIGURATIONS = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in ARM.joints])


def standing(configuration: tuple[float, ...]) -> JointState:
    return JointState(name=ARM.joint_names, position=configuration)


@pytest.mark.parametrize(("start", "goal"), list(permutations(ARM.named_states, 2)))
def test_every_named_state_is_reached_from_every_other(start: str, goal: str):
    response = PLANNER.plan(PlanRequest(goal=NamedGoal(name=goal)), standing(ARM.named_states[start]))
    assert response.code is PlanCode.SUCCESS, response.refusal
    assert response.trajectory.points[-1].positions == ARM.named_states[goal]
    samples = sample(response.trajectory)
    require_within_limits(ARM, samples, joint_limits(ARM))
    assert all(PLANNER.kinematics.collisions.distance(row) > 0.0 for row in samples.positions[::5])


@pytest.mark.parametrize("joint", ARM.joints, ids=ARM.joint_names)
def test_every_joint_can_be_sent_to_both_of_its_limits(joint: Joint):
    """From some named state: from others the arm's own body is in the way."""
    for limit in (joint.lower, joint.upper):
        request = PlanRequest(goal=JointGoal(name=(joint.name,), position=(limit,)))
        answers = [PLANNER.plan(request, standing(configuration)) for configuration in ARM.named_states.values()]
        assert PlanCode.SUCCESS in [answer.code for answer in answers], answers[0].refusal


def test_a_pose_with_an_orientation_is_reached():
    """A turn about the tool's own axis, at another place: what an arm with fewer joints cannot do."""
    tool = PLANNER.kinematics.tool(ARM.named_states["ready"])
    turned = tool.rotation @ pin.rpy.rpyToMatrix(0.0, 0.0, 0.6)
    x, y, z, w = pin.Quaternion(turned).coeffs().tolist()
    point = tuple(np.add(tool.position, (0.04, 0.06, -0.02)).tolist())
    response = PLANNER.plan(
        PlanRequest(goal=PoseGoal(position=point, orientation=(x, y, z, w))), standing(ARM.named_states["ready"])
    )
    assert response.code is PlanCode.SUCCESS, response.refusal
    reached = PLANNER.kinematics.tool(response.trajectory.points[-1].positions)
    assert reached.position == pytest.approx(point, abs=1e-6)
    assert np.abs(reached.rotation - turned).max() < 1e-5


@examples(quick=15, full=150)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_a_tool_position_is_reached_or_refused_for_touching(start: tuple[float, ...], goal: tuple[float, ...]):
    point = tuple(PLANNER.kinematics.tool(goal).position.tolist())
    response = PLANNER.plan(PlanRequest(goal=PoseGoal(position=point)), standing(start))
    if response.code is PlanCode.SUCCESS:
        assert response.tool_goal == pytest.approx(point, abs=1e-6)
        return
    assert response.refusal is not None
    assert response.refusal.check == "self-collision"


def test_full_poses_all_over_the_limits_are_found_from_anywhere():
    """joint_3 and joint_6 turn beyond 180 degrees: the search has to look there too. It misses about 1 in 500."""
    inverse = InverseKinematics(ARM, PLANNER.kinematics)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in ARM.joints]).T
    missed = 0
    for goal, near in np.random.default_rng(3).uniform(lower, upper, (200, 2, 6)):
        pose = PLANNER.kinematics.tool(goal)
        solution = next(inverse.solutions(ToolTarget(pose.position, pose.rotation), near, NEVER), None)
        if solution is None:
            missed += 1
            continue
        assert all(joint.is_within(value) for joint, value in zip(ARM.joints, solution.tolist(), strict=True))
        reached = PLANNER.kinematics.tool(solution)
        assert np.abs(reached.position - pose.position).max() < 1e-6
        assert np.abs(reached.rotation - pose.rotation).max() < 1e-5
    assert missed <= 1
