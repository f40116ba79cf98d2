"""Every refusal names the check, the thing, its value and limit, and what would do."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    FreeMotion,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanCode,
    PlanRequest,
    PlanResponse,
    PointToPoint,
    PoseGoal,
    Refusal,
)
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from tests.profiles import examples
from tests.table import table

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
PLANNER = Planner(ARM)
STANDING = JointState(name=ARM.joint_names, position=(0.0, 0.0, 0.0))


def refused(response: PlanResponse, code: PlanCode) -> Refusal:
    assert response.code is code
    assert response.trajectory.points == ()
    assert response.refusal is not None
    assert response.refusal.check
    assert response.refusal.why is not None
    assert response.refusal.message
    assert response.refusal.remedy
    assert str(response.refusal.why) == f"{response.refusal.message}; {response.refusal.remedy}"
    return response.refusal


def why_of(response: PlanResponse, code: PlanCode) -> Reason:
    why = refused(response, code).why
    assert why is not None
    return why


@table("scaling", [0.0, -1.0, 1.0001])
@table("which", ["velocity_scaling", "acceleration_scaling"])
def test_a_scaling_of_zero_is_not_one(planner: Planner, home: JointState, which: str, scaling: float):
    request = PlanRequest(goal=NamedGoal(name="ready"), **{which: scaling})
    refusal = refused(planner.plan(request, home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert (refusal.subject, refusal.value) == (which, scaling)


def test_a_scaling_that_is_not_a_number_never_becomes_a_request():
    with pytest.raises(ValueError, match=r"velocity_scaling.*finite"):
        PlanRequest(velocity_scaling=float("nan"))


def test_an_unknown_state_has_a_nearest_name(planner: Planner, home: JointState):
    refusal = refused(planner.plan(PlanRequest(goal=NamedGoal(name="redy")), home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert refusal.subject == "redy"
    assert refusal.remedy == 'use "ready"'


def test_an_unknown_joint_has_a_nearest_name(planner: Planner, home: JointState):
    goal = JointGoal(name=("braso_joint",), position=(0.0,))
    refusal = refused(planner.plan(PlanRequest(goal=goal), home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert refusal.remedy == 'use "brazo_joint"'


def test_an_unknown_frame_has_a_nearest_name(planner: Planner, home: JointState):
    goal = PoseGoal(position=(0.0, 0.0, 0.0), frame="base_lnk")
    refusal = refused(planner.plan(PlanRequest(goal=goal), home), PlanCode.FRAME_TRANSFORM_FAILURE)
    assert refusal.remedy == 'use "base_link"'


@pytest.mark.parametrize("beyond", [2e-4, 0.001, 3.0])
def test_a_goal_just_beyond_a_limit_says_by_how_much(planner: Planner, home: JointState, beyond: float):
    goal = JointGoal(name=("brazo_joint",), position=(2.95 + beyond,))
    refusal = refused(planner.plan(PlanRequest(goal=goal), home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert f"rad is {beyond:.4g} rad beyond its upper limit of 2.95 rad" in refusal.message
    assert refusal.nearest == (2.95,)


@pytest.mark.parametrize("beyond", [1e-9, 2.7e-6, 9.9e-5])
def test_a_limit_that_only_rounding_misses_is_the_limit(planner: Planner, home: JointState, beyond: float):
    for value, limit in ((2.95 + beyond, 2.95), (-2.95 - beyond, -2.95)):
        goal = JointGoal(name=("brazo_joint",), position=(value,))
        there = JointState(name=planner.arm.joint_names, position=(0.0, value, 0.2))
        for request, place in (
            (PlanRequest(goal=goal), -1),
            (PlanRequest(goal=NamedGoal(name="home"), start=there), 0),
        ):
            response = planner.plan(request, home)
            assert response.code is PlanCode.SUCCESS, response.refusal
            assert limit in response.trajectory.points[place].positions


def test_a_joint_beyond_its_limit_is_clamped_in_the_goals_own_form(planner: Planner, home: JointState):
    goal = JointGoal(name=("efector_joint", "brazo_joint"), position=(0.1, -3.5))
    refusal = refused(planner.plan(PlanRequest(goal=goal), home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert (refusal.check, refusal.subject, refusal.value, refusal.limit) == ("joint limit", "brazo_joint", -3.5, -2.95)
    assert refusal.nearest == (0.1, -2.95)


@pytest.mark.parametrize(
    "goal",
    [
        JointGoal(),
        JointGoal(name=("brazo_joint",)),
        JointGoal(name=("brazo_joint", "brazo_joint"), position=(0.0, 1.0)),
        PoseGoal(position=(0.1, 0.2)),
    ],
)
def test_a_goal_that_says_too_little_or_two_things_is_refused(planner: Planner, home: JointState, goal: Any):
    refused(planner.plan(PlanRequest(goal=goal), home), PlanCode.INVALID_GOAL_CONSTRAINTS)


def test_an_orientation_is_refused_by_an_arm_that_cannot_choose_it(planner: Planner, home: JointState):
    goal = PoseGoal(position=(0.25, 0.15, 0.1), orientation=(0.0, 0.0, 0.0, 1.0))
    why = why_of(planner.plan(PlanRequest(goal=goal), home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert why.code == "plan.orientation.impossible"
    assert why.values["missing"] == pytest.approx(math.pi)
    assert why.causes == (because("plan.turns.no_tilt", robot="rm1"),)
    assert why.remedies == (remedy("position_alone"), remedy("position_and_yaw"))


@pytest.mark.parametrize(
    ("goal", "subject", "nearest"),
    [
        ((0.25, 0.15, 0.3), "z", (0.25, 0.15, 0.2176)),
        ((0.25, 0.15, -0.1), "z", (0.25, 0.15, 0.0177)),
        ((0.6, 0.0, 0.1), "x", (0.4063, 0.0, 0.1)),
    ],
)
def test_out_of_reach_names_the_axis_and_the_nearest_point(
    planner: Planner, home: JointState, goal: tuple[float, ...], subject: str, nearest: tuple[float, ...]
):
    refusal = refused(planner.plan(PlanRequest(goal=PoseGoal(position=goal)), home), PlanCode.NO_IK_SOLUTION)
    assert (refusal.check, refusal.subject) == ("reach", subject)
    assert refusal.nearest == pytest.approx(nearest, abs=3e-4)


def test_a_joint_that_holds_the_tool_back_is_named(planner: Planner, home: JointState):
    response = planner.plan(PlanRequest(goal=PoseGoal(position=(0.25, 0.15, 0.3))), home)
    why = why_of(response, PlanCode.NO_IK_SOLUTION)
    assert why.code == "plan.reach.held"
    assert because("plan.held", joint="efector_joint", side="upper", limit=0.2, unit="m") in why.causes


@examples(quick=15, full=60)
@given(st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8), st.floats(-0.3, 0.5)))
def test_the_nearest_goal_of_a_refusal_is_planned_when_asked_for(goal: tuple[float, ...]):
    response = PLANNER.plan(PlanRequest(goal=PoseGoal(position=goal)), STANDING)
    if response.code is PlanCode.SUCCESS:
        return
    assert response.refusal is not None
    again = PLANNER.plan(PlanRequest(goal=PoseGoal(position=response.refusal.nearest)), STANDING)
    assert again.code is PlanCode.SUCCESS, (goal, response.refusal, again.refusal)


def test_a_goal_in_self_collision_names_the_pair_and_how_far_it_can_go(planner: Planner, home: JointState):
    goal = JointGoal(name=("antebrazo_joint",), position=(2.9,))
    refusal = refused(planner.plan(PlanRequest(goal=goal), home), PlanCode.GOAL_IN_COLLISION)
    assert refusal.subject == "base_link / efector_link"
    again = planner.plan(PlanRequest(goal=JointGoal(name=goal.name, position=refusal.nearest)), home)
    assert again.code is PlanCode.SUCCESS


def test_a_way_through_itself_names_the_pair(planner: Planner, rm1: ArmDescription):
    """From above the upper arm to beside the base: the straight way sinks into the arm before it is out."""
    start, goal = (0.0, 2.92, 0.2), (0.0, 2.66, 0.0)
    response = planner.plan(
        PlanRequest(goal=JointGoal(name=rm1.joint_names, position=goal), motion=PointToPoint()),
        JointState(name=rm1.joint_names, position=start),
    )
    refusal = refused(response, PlanCode.PLANNING_FAILED)
    assert refusal.check == "self-collision"
    assert "efector_link" in refusal.subject
    assert "go via another configuration" in refusal.remedy


def test_a_start_in_collision_is_not_planned_from(planner: Planner, rm1: ArmDescription):
    start = JointState(name=rm1.joint_names, position=(0.0, 2.9, 0.0))
    refusal = refused(planner.plan(PlanRequest(goal=NamedGoal(name="home")), start), PlanCode.START_STATE_IN_COLLISION)
    assert refusal.why is not None
    assert refusal.why.code == "plan.collision.start"
    assert refusal.why.causes[0].code == "plan.pair.touch"
    pairs = {(cause.values["first"], cause.values["second"]) for cause in refusal.why.causes}
    assert ("base_link", "efector_link") in pairs


def test_an_arm_that_touches_what_it_carries_is_told_what_to_do(rm1: ArmDescription, home: JointState):
    planner = Planner(rm1)
    held = SceneObject(name="held", shape=BoxShape(size=(0.4, 0.4, 0.4)), frame=rm1.tool_frame, attached=True)
    planner.set_world(World(rm1, planner.kinematics, PlanningScene(version=1, objects=(held,))))
    for motion in (FreeMotion(), PointToPoint(), LinearMotion()):
        request = PlanRequest(goal=NamedGoal(name="ready"), motion=motion)
        refusal = refused(planner.plan(request, home), PlanCode.START_STATE_IN_COLLISION)
        assert refusal.why is not None
        assert refusal.why.causes[0].code == "plan.pair.touch"
        assert refusal.why.causes[0].values["second"] == "held"
        assert refusal.why.causes[0].values["second_kind"] == "box"
        assert refusal.why.remedies[-2:] == (remedy("touch_links", object="held"), remedy("let_go", object="held"))


def test_no_joint_state_is_said(planner: Planner):
    why = why_of(planner.plan(PlanRequest(goal=NamedGoal(name="home")), None), PlanCode.ROBOT_STATE_STALE)
    assert why.code == "plan.state.none"


def test_a_stale_joint_state_is_said_with_its_age(planner: Planner, home: JointState):
    refusal = refused(planner.plan(PlanRequest(goal=NamedGoal(name="home")), home, age=3.0), PlanCode.ROBOT_STATE_STALE)
    assert (refusal.value, refusal.limit) == (3.0, 0.5)


def test_a_joint_state_without_a_joint_is_said(planner: Planner):
    state = JointState(name=("brazo_joint",), position=(0.0,))
    why = why_of(planner.plan(PlanRequest(goal=NamedGoal(name="home")), state), PlanCode.INVALID_ROBOT_STATE)
    assert why.code == "plan.state.incomplete"
    assert why.values == {"joints": ("antebrazo_joint", "efector_joint")}


def test_a_moving_start_is_refused_with_the_joint(planner: Planner, rm1: ArmDescription):
    state = JointState(name=rm1.joint_names, position=(0.0, 0.0, 0.0), velocity=(0.0, 0.5, 0.0))
    refusal = refused(planner.plan(PlanRequest(goal=NamedGoal(name="ready")), state), PlanCode.INVALID_ROBOT_STATE)
    assert (refusal.check, refusal.subject, refusal.value) == ("moving start", "antebrazo_joint", 0.5)


def test_a_start_outside_the_limits_is_refused(planner: Planner, rm1: ArmDescription):
    state = JointState(name=rm1.joint_names, position=(3.0, 0.0, 0.0))
    refusal = refused(planner.plan(PlanRequest(goal=NamedGoal(name="ready")), state), PlanCode.INVALID_ROBOT_STATE)
    assert (refusal.subject, refusal.value, refusal.limit) == ("brazo_joint", 3.0, 2.95)


def test_a_scaling_that_would_take_days_is_refused(planner: Planner, home: JointState):
    request = PlanRequest(goal=NamedGoal(name="ready"), velocity_scaling=1e-9)
    why = why_of(planner.plan(request, home), PlanCode.PLANNING_FAILED)
    assert why.code == "plan.verification"
    assert why.causes[0].code == "plan.timing.too_long"
    assert why.causes[0].values["most"] == 86400.0


@table("allowed", [0.0, -1.0, -1e300, 120.5, 1e300])
@table("motion", [FreeMotion(), PointToPoint(), LinearMotion()])
def test_no_time_and_too_much_are_refused(planner: Planner, home: JointState, motion: Motion, allowed: float):
    request = PlanRequest(goal=NamedGoal(name="ready"), motion=motion, allowed_time=allowed)
    refusal = refused(planner.plan(request, home), PlanCode.INVALID_GOAL_CONSTRAINTS)
    assert refusal.subject == "allowed_time"


def test_a_search_without_time_is_timed_out(planner: Planner, home: JointState):
    request = PlanRequest(goal=PoseGoal(position=(0.6, 0.0, 0.1)))
    refusal = refused(planner.plan(request, home, clock=itertools.count().__next__), PlanCode.TIMED_OUT)
    assert refusal.subject == "allowed_time"


@examples(quick=30)
@given(st.builds(
    PlanRequest,
    goal=st.one_of(
        st.builds(NamedGoal, name=st.text(max_size=8)),
        st.builds(
            JointGoal,
            name=st.lists(st.sampled_from(["brazo_joint", "efector_joint", "x"]), max_size=3).map(tuple),
            position=st.lists(st.floats(-1e12, 1e12), max_size=3).map(tuple),
        ),
        st.builds(
            PoseGoal,
            position=st.lists(st.floats(-1e12, 1e12), max_size=4).map(tuple),
            orientation=st.lists(st.floats(-1.0, 1.0), max_size=4).map(tuple),
            frame=st.sampled_from(["", "base_link", "efector_link", "nowhere"]),
        ),
    ),
    velocity_scaling=st.floats(-1.0, 2.0),
    acceleration_scaling=st.floats(1e-300, 1.0),
))  # fmt: skip
def test_whatever_is_asked_there_is_a_plan_or_a_reason(request_: PlanRequest):
    response = PLANNER.plan(request_, STANDING)
    if response.code is PlanCode.SUCCESS:
        assert response.trajectory.points
    else:
        refused(response, response.code)
