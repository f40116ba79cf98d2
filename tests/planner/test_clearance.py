"""The clearance of a plan: from the robot or the request, kept everywhere, and said where it is what refuses."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    FreeMotion,
    IkRequest,
    JointGoal,
    LinearMotion,
    PlanCode,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    ValidityRequest,
)
from gemelo.schemas.reasons import remedy
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE, usable_clearance
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.kinematics.kinematic_requests import KinematicRequests
from gemelo.services.planner.verification.verify import sample

GOAL = (0.9, 0.6, 0.1)
GAP = 0.0015  # [m] between the tool at the goal and the box below it


@pytest.fixture(scope="module")
def world(rm1: ArmDescription) -> World:
    """With a slab `GAP` [m] below the tool at the goal, and otherwise far from the arm."""
    planner = Planner(rm1)
    low, high = -1.0, float(planner.kinematics.tool(GOAL).position[2])
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _slab(rm1, planner, middle).distance(GOAL) > GAP else (low, middle)
    return _slab(rm1, planner, low)


def _slab(rm1: ArmDescription, planner: Planner, top: float) -> World:
    x, y, _ = planner.kinematics.tool(GOAL).position.tolist()
    shape = SceneObject(
        name="slab", shape=BoxShape(size=(0.1, 0.1, 0.01)), pose=Transform(translation=(x, y, top - 0.005))
    )
    return World(rm1, planner.kinematics, PlanningScene(version=1, objects=(shape,)))


def request(rm1: ArmDescription, **more: object) -> PlanRequest:
    start = JointState(name=rm1.joint_names, position=(0.9, 0.6, 0.15))
    goal = JointGoal(name=rm1.joint_names, position=GOAL)
    return PlanRequest(**{"start": start, "goal": goal, **more})  # type: ignore[arg-type]


def in_world(arm: ArmDescription, world: World) -> Planner:
    planner = Planner(arm)
    planner.set_world(World(arm, planner.kinematics, world.scene))
    return planner


def test_a_refused_goal_says_how_near_between_what_and_which_clearance_would_do(rm1: ArmDescription, world: World):
    assert world.distance(GOAL) == pytest.approx(GAP, abs=1e-5)
    planner = in_world(rm1, world)
    response = planner.plan(request(rm1), None)
    refusal = response.refusal
    assert refusal is not None
    assert response.code is PlanCode.GOAL_IN_COLLISION
    assert refusal.value == pytest.approx(GAP, abs=1e-5)
    assert refusal.limit == CLEARANCE
    assert "slab" in refusal.subject
    assert refusal.why is not None
    assert refusal.why.code == "plan.collision.goal"
    assert refusal.why.causes[0].code == "plan.pair.apart"
    assert refusal.why.causes[0].values["limit"] == CLEARANCE
    assert refusal.why.causes[0].values["distance"] == pytest.approx(GAP, abs=1e-5)
    assert remedy("smaller_clearance", clearance=0.0014) in refusal.why.remedies
    assert planner.plan(request(rm1, clearance=0.0014), None).code is PlanCode.SUCCESS


@pytest.mark.parametrize("motion", [FreeMotion(), PointToPoint(), LinearMotion(), FreeMotion(planner_id="RRTConnect")])
def test_a_smaller_clearance_lets_the_arm_nearer_and_is_kept(rm1: ArmDescription, world: World, motion: object):
    planner = in_world(rm1, world)
    goal: object = JointGoal(name=rm1.joint_names, position=GOAL)
    if isinstance(motion, LinearMotion):
        x, y, z = planner.kinematics.tool(GOAL).position.tolist()
        goal = PoseGoal(position=(x, y, z))
    asked = request(rm1, clearance=0.001, motion=motion, goal=goal)
    response = planner.plan(asked, None)
    assert response.code is PlanCode.SUCCESS, response.refusal
    rows = sample(response.trajectory).positions
    nearest = min(world.distance(row) for row in rows[:: max(1, len(rows) // 200)])
    assert 0.001 <= nearest <= GAP + 1e-4
    assert planner.plan(msgspec.structs.replace(asked, clearance=None), None).code is not PlanCode.SUCCESS


def test_the_robots_own_clearance_counts_where_the_request_says_none(rm1: ArmDescription, world: World):
    near = replace(rm1, clearance=0.001)
    assert in_world(near, world).plan(request(rm1), None).code is PlanCode.SUCCESS
    refused = in_world(near, world).plan(request(rm1, clearance=0.004), None)
    assert refused.refusal is not None
    assert refused.refusal.limit == 0.004


def test_ik_and_validity_keep_the_robots_clearance_and_say_how_near(rm1: ArmDescription, world: World):
    kinematic = KinematicRequests(rm1)
    asked = ValidityRequest(name=rm1.joint_names, position=GOAL)
    refusal = kinematic.validity(asked, None, 0.0, world).refusal
    assert refusal is not None
    assert refusal.value == pytest.approx(GAP, abs=1e-5)
    near = replace(rm1, clearance=0.001)
    kinematics = Planner(near).kinematics
    there = World(near, kinematics, world.scene)
    assert kinematic.validity(asked, None, 0.0, there).code is PlanCode.SUCCESS
    x, y, z = kinematics.tool(GOAL).position.tolist()
    pose = IkRequest(goal=PoseGoal(position=(x, y, z)), near=JointState(name=rm1.joint_names, position=GOAL))
    told = kinematic.ik(pose, None, 0.0, world).refusal
    assert told is not None
    assert told.value is not None
    assert told.value < CLEARANCE
    assert kinematic.ik(pose, None, 0.0, there).code is PlanCode.SUCCESS


@pytest.mark.parametrize("asked", [0.0, 0.0004, -0.001, 0.051, 4.0])
def test_a_clearance_that_cannot_be_kept_is_refused_with_its_value_and_range(
    rm1: ArmDescription, planner: Planner, asked: float
):
    response = planner.plan(request(rm1, clearance=asked), None)
    refusal = response.refusal
    assert refusal is not None
    assert response.code is PlanCode.INVALID_GOAL_CONSTRAINTS
    assert (refusal.subject, refusal.value) == ("clearance", asked)
    assert refusal.why is not None
    assert refusal.why.code == "plan.clearance.range"
    assert refusal.why.values == {"value": asked, "least": 0.0005, "most": 0.05}


@pytest.mark.parametrize("asked", [0.0005, 0.05])
def test_the_ends_of_the_range_are_kept(rm1: ArmDescription, planner: Planner, asked: float):
    response = planner.plan(request(rm1, clearance=asked), None)
    assert response.refusal is None or response.refusal.subject != "clearance"


def test_the_clearance_of_one_plan_is_not_the_next_ones(rm1: ArmDescription, world: World):
    planner = in_world(rm1, world)
    assert planner.plan(request(rm1, clearance=0.001), None).code is PlanCode.SUCCESS
    assert planner.plan(request(rm1), None).code is PlanCode.GOAL_IN_COLLISION


def test_a_line_that_comes_too_near_says_the_clearance_that_would_do(rm1: ArmDescription, world: World):
    planner = in_world(rm1, world)
    lower = tuple(np.add(GOAL, (0.5, 0.0, 0.0)).tolist())
    begin = tuple(np.add(GOAL, (-0.5, 0.0, 0.0)).tolist())
    over = request(
        rm1,
        start=JointState(name=rm1.joint_names, position=begin),
        goal=JointGoal(name=rm1.joint_names, position=lower),
        motion=PointToPoint(),
    )
    refusal = planner.plan(over, None).refusal
    assert refusal is not None
    assert refusal.value is not None
    assert refusal.value <= CLEARANCE + 0.0002
    assert refusal.why is not None
    usable = next(each.values["clearance"] for each in refusal.why.remedies if each.code == "smaller_clearance")
    assert planner.plan(msgspec.structs.replace(over, clearance=usable), None).code is PlanCode.SUCCESS


@pytest.mark.parametrize(
    ("distance", "usable"), [(0.0015, 0.0014), (0.00057, 0.0005), (0.0005, None), (-0.01, None), (0.0041, 0.0039)]
)
def test_the_clearance_that_would_do_is_kept_by_the_two_and_may_be_asked_for(distance: float, usable: float | None):
    assert usable_clearance(distance, 0.004) == usable


def test_validity_takes_a_limit_that_only_rounding_misses_and_nothing_farther_beyond_it(rm1: ArmDescription):
    kinematic, free = KinematicRequests(rm1), World(rm1, Planner(rm1).kinematics, PlanningScene())
    home = JointState(name=rm1.joint_names, position=(0.0, 0.0, 0.0))
    codes = [
        kinematic.validity(ValidityRequest(name=("brazo_joint",), position=(2.95 + beyond,)), home, 0.0, free).code
        for beyond in (9e-5, 2e-4)
    ]
    assert codes == [PlanCode.SUCCESS, PlanCode.INVALID_GOAL_CONSTRAINTS]
