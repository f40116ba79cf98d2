"""Plans that succeed: where they lead, from where, and how they are verified."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, NamedGoal, PlanCode, PlanRequest, PoseGoal
from gemelo.services.planner.core import Planner
from gemelo.services.planner.request.refusals import PlanRefused
from gemelo.services.planner.request.start_state import resolve_start
from gemelo.services.planner.timing.profile import joint_limits
from gemelo.services.planner.verification.verify import require_within_limits, sample
from tests.profiles import examples

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
PLANNER = Planner(ARM)
CONFIGURATIONS = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in ARM.joints])


def standing(configuration: tuple[float, ...]) -> JointState:
    return JointState(name=ARM.joint_names, position=configuration)


def test_the_readmes_goal_is_reached(planner: Planner, home: JointState):
    response = planner.plan(PlanRequest(goal=PoseGoal(position=(0.25, 0.15, 0.10))), home)
    assert response.code is PlanCode.SUCCESS
    assert response.tool_goal == pytest.approx((0.25, 0.15, 0.10), abs=1e-6)
    last = response.trajectory.points[-1]
    assert planner.kinematics.tool(last.positions).position == pytest.approx((0.25, 0.15, 0.10), abs=1e-6)
    assert response.duration == last.time_from_start
    assert response.trajectory.joint_names == planner.arm.joint_names


def test_every_named_state_is_reached_from_every_other(planner: Planner, rm1: ArmDescription):
    for start in rm1.named_states.values():
        for name, goal in rm1.named_states.items():
            response = planner.plan(PlanRequest(goal=NamedGoal(name=name)), standing(start))
            assert response.code is PlanCode.SUCCESS, (start, name, response.refusal)
            assert response.trajectory.points[-1].positions == goal


def test_a_joint_goal_leaves_the_other_joints_alone(planner: Planner, rm1: ArmDescription):
    start = rm1.named_states["ready"]
    response = planner.plan(PlanRequest(goal=JointGoal(name=("brazo_joint",), position=(0.5,))), standing(start))
    assert response.trajectory.points[-1].positions == (0.5, *start[1:])


def test_a_start_in_the_request_is_used_and_completed(planner: Planner, home: JointState):
    given_start = JointState(name=("brazo_joint",), position=(0.7,))
    response = planner.plan(PlanRequest(goal=NamedGoal(name="ready"), start=given_start), home)
    assert response.trajectory.points[0].positions == (0.7, 0.0, 0.0)


def test_a_whole_start_needs_no_present_state(planner: Planner, home: JointState):
    assert planner.plan(PlanRequest(goal=NamedGoal(name="ready"), start=home), None).code is PlanCode.SUCCESS


def test_a_goal_in_a_links_frame_moves_with_that_link(planner: Planner):
    start = (0.3, 0.8, 0.05)
    request = PlanRequest(goal=PoseGoal(position=(0.15, 0.1, -0.05), frame="antebrazo_link"))
    response = planner.plan(request, standing(start))
    link = planner.kinematics.link_poses(start)["antebrazo_link"]
    cosine, sine = np.cos(1.1), np.sin(1.1)
    offset = (0.15 * cosine - 0.1 * sine, 0.15 * sine + 0.1 * cosine, -0.05)
    expected = np.add(link.translation, offset)
    assert response.tool_goal == pytest.approx(expected, abs=1e-6)


def test_scaling_slows(planner: Planner, home: JointState):
    fast, slow = (
        planner.plan(
            PlanRequest(goal=NamedGoal(name="left"), velocity_scaling=s, acceleration_scaling=s), home
        ).duration
        for s in (1.0, 0.25)
    )
    assert slow > 2.0 * fast


def test_a_goal_where_the_arm_is_is_a_plan_that_stands(planner: Planner, home: JointState):
    response = planner.plan(PlanRequest(goal=NamedGoal(name="home")), home)
    assert response.code is PlanCode.SUCCESS
    assert response.duration == 0.1


def test_a_whole_start_is_the_same_in_whatever_order_its_joints_are_named(rm1: ArmDescription):
    ready = rm1.named_states["ready"]
    shuffled = JointState(name=rm1.joint_names[::-1], position=ready[::-1])
    for given_start, present in ((standing(ready), None), (shuffled, None), (None, standing(ready))):
        assert resolve_start(rm1, given_start, present, 0.0) == ready
    with pytest.raises(PlanRefused, match=r"is 1\.000 s old"):
        resolve_start(rm1, None, standing(ready), 1.0)


def test_a_start_rounded_to_whole_steps_beyond_a_limit_is_still_a_start(planner: Planner, rm1: ArmDescription):
    scale = rm1.joint("antebrazo_joint").steps
    rounded = scale.to_position(round(scale.to_steps(2.95)))
    assert rounded > 2.95
    response = planner.plan(PlanRequest(goal=NamedGoal(name="home")), standing((0.0, rounded, 0.2)))
    assert response.code is PlanCode.SUCCESS
    assert response.trajectory.points[0].positions == (0.0, 2.95, 0.2)


def test_from_limit_to_limit_of_every_joint_and_back(planner: Planner, rm1: ArmDescription):
    """Standing exactly at a limit is standing within it, and a goal may be there too."""
    for first, last in (("lower", "upper"), ("upper", "lower")):
        for joint in (rm1.joint("brazo_joint"), rm1.joint("efector_joint")):
            ends = [tuple(getattr(joint, side) if j is joint else 0.0 for j in rm1.joints) for side in (first, last)]
            goal = JointGoal(name=rm1.joint_names, position=ends[1])
            response = planner.plan(PlanRequest(goal=goal), standing(ends[0]))
            assert response.code is PlanCode.SUCCESS
            points = response.trajectory.points
            assert (points[0].positions, points[-1].positions) == (ends[0], ends[1])
            require_within_limits(rm1, sample(response.trajectory), joint_limits(rm1))


@examples(quick=30, full=150)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_whatever_comes_out_is_within_limits_and_free(start: tuple[float, ...], goal: tuple[float, ...]):
    point = tuple(PLANNER.kinematics.tool(goal).position.tolist())
    response = PLANNER.plan(PlanRequest(goal=PoseGoal(position=point)), standing(start))
    if response.code is not PlanCode.SUCCESS:
        assert response.refusal is not None
        assert response.refusal.check == "self-collision"
        assert response.trajectory.points == ()
        return
    assert response.tool_goal == pytest.approx(point, abs=1e-6)
    assert response.trajectory.points[0].positions == start
    samples = sample(response.trajectory)
    require_within_limits(ARM, samples, joint_limits(ARM))
    assert all(PLANNER.kinematics.collisions.distance(row) > 0.0 for row in samples.positions[::7])


def test_the_planned_path_is_the_tools_way(planner: Planner, home: JointState):
    response = planner.plan(PlanRequest(goal=NamedGoal(name="ready")), home)
    path = planner.planned_path(response.trajectory, stamp=7)
    assert (path.stamp, path.frame) == (7, "base_link")
    assert path.points[0] == pytest.approx(planner.kinematics.tool((0.0, 0.0, 0.0)).position)
    assert path.points[-1] == pytest.approx(response.tool_goal)
    assert len(path.points) <= 100


def test_the_same_request_has_the_same_answer(planner: Planner, home: JointState):
    request = PlanRequest(goal=PoseGoal(position=(0.1, -0.2, 0.15)))
    assert planner.plan(request, home) == planner.plan(request, home)


def test_a_plan_takes_milliseconds(planner: Planner, home: JointState):
    """The goal is 2 ms; this bound only catches a planner that has become something else."""
    request = PlanRequest(goal=PoseGoal(position=(0.25, 0.15, 0.10)))
    began = time.perf_counter()
    for _ in range(20):
        planner.plan(request, home)
    assert time.perf_counter() - began < 5.0
