"""Narrow cases on both arms: slots, boxes, their own bodies, goals and starts that touch, limits, singularities."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from gemelo.schemas.frames import Transform
from gemelo.schemas.planning import (
    FreeMotion,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanCode,
    PlanResponse,
    PointToPoint,
    PoseGoal,
)
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.core import Planner
from tests.planner.independent import Array, Judge
from tests.planner.judging import (
    asked,
    joints,
    planner_of,
    quaternion_of,
    require_reached,
    require_refused,
    require_sound,
    show,
)

ARMS = pytest.mark.parametrize("name", ["rm1", "parol6"])
Configuration = tuple[float, ...]
SWING = {
    "rm1": ((-0.6, 0.4, 0.05), (0.6, 0.4, 0.05)),
    "parol6": ((-0.7, -1.2, 3.1, 0.0, 0.0, 3.14), (0.7, -1.2, 3.1, 0.0, 0.0, 3.14)),
}
FAR = {"rm1": (0.6, 0.0, 0.1), "parol6": (0.9, 0.2, 0.3)}  # [m]


def box(name: str, size: Configuration, place: Array, rotation: Array | None = None) -> SceneObject:
    quaternion = quaternion_of(np.eye(3) if rotation is None else rotation)
    pose = Transform(translation=tuple(map(float, place)), rotation=quaternion)
    return SceneObject(name=name, shape=BoxShape(size=size), pose=pose)


def planned(planner: Planner, start: Configuration, goal: Configuration, motion: Motion) -> PlanResponse:
    """Sound and exact where it succeeds."""
    request = asked(planner, start, joints(planner, goal), motion=motion)
    response = planner.plan(request, None)
    if response.code is PlanCode.SUCCESS:
        require_sound(planner, request, response)
        require_reached(planner, request, response)
    return response


def in_slot(planner: Planner) -> tuple[Configuration, Configuration]:
    """Shows two boards, one on either side of the tool; gives a configuration in there, and one beside it as deep."""
    inside = {"rm1": (0.5, 0.5, 0.02), "parol6": (0.0, -1.4, 3.3, 0.0, -0.33, 3.14)}[planner.arm.name]
    half, depth, out = {"rm1": (0.021, 0.1, -0.04), "parol6": (0.0310, 0.05, 0.0)}[planner.arm.name]
    position, rotation = Judge(planner.arm).tool(np.array(inside))
    boards = []
    for side, name in ((-1.0, "left board"), (1.0, "right board")):
        offset = np.array((0.0, side * (half + 0.010 + 0.005), out))
        boards.append(box(name, (0.12, 0.01, depth), position + rotation @ offset, rotation))
    show(planner, PlanningScene(version=4, objects=tuple(boards)))
    return inside, (inside[0] + 0.9, *inside[1:])


@ARMS
@pytest.mark.parametrize("planner_id", ["", "RRTConnect"])
def test_the_arm_reaches_into_a_slot_and_out_again(name: str, planner_id: str):
    planner = planner_of(name)
    inside, beside = in_slot(planner)
    assert CLEARANCE < Judge(planner.arm, planner.checker.newest.scene).nearest(np.array(inside)).distance < 0.013
    for start, goal in ((beside, inside), (inside, beside)):
        refusal = require_refused(planned(planner, start, goal, PointToPoint()))
        assert "board" in refusal.subject
        response = planned(planner, start, goal, FreeMotion(planner_id=planner_id))
        assert response.code is PlanCode.SUCCESS, response.refusal
        assert response.planner_id != "straight"


@ARMS
def test_a_box_between_start_and_goal_is_gone_around_and_named_by_those_who_may_not(name: str):
    planner = planner_of(name)
    start, goal = SWING[name]
    middle = planner.kinematics.tool(0.5 * np.add(start, goal)).position
    show(planner, PlanningScene(version=2, objects=(box("crate", (0.06, 0.06, 0.06), middle),)))
    refusal = require_refused(planned(planner, start, goal, PointToPoint()))
    assert "crate" in refusal.subject
    assert "box crate" in refusal.message
    judge = Judge(planner.arm, planner.checker.newest.scene)
    assert judge.nearest(np.array(refusal.configuration)).distance <= CLEARANCE + 1e-5
    assert planned(planner, start, goal, FreeMotion()).code is PlanCode.SUCCESS


OWN_BODY = (
    ("rm1", (0.0, 2.92, 0.2), (0.0, 2.66, 0.0)),
    ("rm1", (0.5, -2.92, 0.2), (-0.5, -2.66, 0.0)),
    ("parol6", (-1.86, -1.68, 2.03, 0.35, 0.24, 5.59), (1.95, -2.33, 2.25, -0.6, -1.43, 3.6)),
    ("parol6", (-1.18, -1.71, 2.1, 0.42, -1.12, 0.49), (1.23, -1.7, 2.06, -1.0, -1.37, 5.77)),
    ("parol6", (1.21, -0.21, 2.5, 1.21, -1.39, 0.21), (-1.43, -1.07, 1.95, 1.74, 0.18, 4.38)),
)


@pytest.mark.parametrize(("name", "start", "goal"), OWN_BODY)
def test_the_arm_goes_around_its_own_body(name: str, start: Configuration, goal: Configuration):
    planner = planner_of(name)
    show(planner, PlanningScene())
    straight = np.array(start) + np.linspace(0.0, 1.0, 200)[:, None] * np.subtract(goal, start)
    assert Judge(planner.arm).touch(straight) is not None
    refusal = require_refused(planned(planner, start, goal, PointToPoint()))
    assert refusal.check == "self-collision"
    response = planned(planner, start, goal, FreeMotion())
    assert response.code is PlanCode.SUCCESS, response.refusal


@ARMS
@pytest.mark.parametrize("motion", [FreeMotion(), PointToPoint()])
def test_a_goal_in_a_box_names_it_and_gives_a_goal_before_it_that_will_do(name: str, motion: Motion):
    planner = planner_of(name)
    start, goal = SWING[name]
    there = planner.kinematics.tool(goal).position
    show(planner, PlanningScene(version=2, objects=(box("crate", (0.06, 0.06, 0.06), there),)))
    response = planned(planner, start, goal, motion)
    refusal = require_refused(response)
    assert response.code is PlanCode.GOAL_IN_COLLISION
    assert "crate" in refusal.subject
    assert planned(planner, start, refusal.nearest, motion).code is PlanCode.SUCCESS
    by_place = planner.plan(asked(planner, start, PoseGoal(position=tuple(there.tolist())), motion=motion), None)
    assert require_refused(by_place).check == "collision"


@ARMS
@pytest.mark.parametrize("motion", [FreeMotion(), PointToPoint(), LinearMotion()])
def test_a_start_in_a_box_names_it_and_what_to_do(name: str, motion: Motion):
    planner = planner_of(name)
    start, goal = SWING[name]
    there = planner.kinematics.tool(start).position
    show(planner, PlanningScene(version=2, objects=(box("crate", (0.06, 0.06, 0.06), there),)))
    response = planned(planner, start, goal, motion)
    refusal = require_refused(response)
    assert response.code is PlanCode.START_STATE_IN_COLLISION
    assert "crate" in refusal.subject
    assert "crate" in refusal.remedy
    show(planner, PlanningScene(version=3))
    assert planned(planner, start, goal, FreeMotion()).code is PlanCode.SUCCESS


@ARMS
@pytest.mark.parametrize("beyond", [2e-4, 1e-3])
def test_a_goal_just_outside_a_limit_is_refused_and_the_limit_itself_is_not(name: str, beyond: float):
    planner = planner_of(name)
    show(planner, PlanningScene())
    ready = planner.arm.named_states["ready"]
    reached = 0
    for joint in planner.arm.joints:
        for value in (joint.lower - beyond, joint.upper + beyond):
            request = asked(planner, ready, JointGoal(name=(joint.name,), position=(value,)))
            refusal = require_refused(planner.plan(request, None))
            assert (refusal.check, refusal.subject, refusal.value) == ("joint limit", joint.name, value)
            assert refusal.nearest == (joint.clamp(value),)
            nearest = msgspec.structs.replace(request, goal=JointGoal(name=(joint.name,), position=refusal.nearest))
            response = planner.plan(nearest, None)
            if response.code is PlanCode.SUCCESS:
                require_sound(planner, nearest, response)
                require_reached(planner, nearest, response)
                reached += 1
            else:
                assert require_refused(response).check == "self-collision"
    assert reached >= len(planner.arm.joints)


@ARMS
@pytest.mark.parametrize("motion", [FreeMotion(), PointToPoint(), LinearMotion()])
def test_a_place_out_of_reach_is_refused_with_the_nearest_that_is_not(name: str, motion: Motion):
    planner = planner_of(name)
    show(planner, PlanningScene())
    ready = planner.arm.named_states["ready"]
    response = planner.plan(asked(planner, ready, PoseGoal(position=FAR[name]), motion=motion), None)
    refusal = require_refused(response)
    assert response.code is PlanCode.NO_IK_SOLUTION
    assert refusal.check == "reach"
    again = asked(planner, ready, PoseGoal(position=refusal.nearest))
    second = planner.plan(again, None)
    require_sound(planner, again, second)
    require_reached(planner, again, second)


@pytest.mark.parametrize(("name", "start"), [("parol6", "home"), ("rm1", (0.3, 0.0, 0.1)), ("rm1", (0.0, 2.4, 0.19))])
def test_an_arm_in_a_singular_configuration_gets_out_of_it(name: str, start: str | Configuration):
    """Freely always; on a line where that leads inwards, and otherwise the singularity is named."""
    planner = planner_of(name)
    show(planner, PlanningScene())
    begin = planner.arm.named_states[start] if isinstance(start, str) else start
    position = planner.kinematics.tool(begin).position
    for motion in (FreeMotion(), PointToPoint()):
        request = asked(planner, begin, NamedGoal(name="ready"), motion=motion)
        response = planner.plan(request, None)
        require_sound(planner, request, response)
        place = position * (0.9, 0.9, 1.0)
        request = asked(planner, begin, PoseGoal(position=tuple(place.tolist())), motion=motion)
        response = planner.plan(request, None)
        require_sound(planner, request, response)
        require_reached(planner, request, response)
    drawn = 0
    for way in ((-0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, -0.02), (0.02, 0.0, 0.0)):
        request = asked(planner, begin, PoseGoal(position=tuple((position + way).tolist())), motion=LinearMotion())
        response = planner.plan(request, None)
        if response.code is PlanCode.SUCCESS:
            require_sound(planner, request, response)
            require_reached(planner, request, response)
            drawn += 1
        else:
            assert require_refused(response).check in ("singularity", "reach", "joint limit")
    assert drawn


@ARMS
def test_the_arm_as_it_is_drawn_goes_around_too(name: str):
    """Its meshes, in convex pieces, keep clear of what its collision shapes were planned around."""
    planner = planner_of(name)
    start, goal = SWING[name]
    middle = planner.kinematics.tool(0.5 * np.add(start, goal)).position
    show(planner, PlanningScene(version=2, objects=(box("crate", (0.06, 0.06, 0.06), middle),)))
    request = asked(planner, start, joints(planner, goal))
    motion = require_sound(planner, request, planner.plan(request, None))
    assert Judge(planner.arm, planner.checker.newest.scene, is_drawn=True).touch(motion.positions) is None


def test_a_lid_over_the_motor_of_rm1s_forearm_is_seen():
    planner = planner_of("rm1")
    start, goal = (-0.8, 0.0, 0.1), (0.8, 0.0, 0.1)
    origin, turned = Judge(planner.arm).pose("antebrazo_link", np.array((0.0, 0.0, 0.1)))
    place = origin + turned @ np.array((0.15, 0.001, 0.107))
    show(planner, PlanningScene(version=1, objects=(box("lid", (0.03, 0.03, 0.02), place),)))
    assert "lid" in require_refused(planned(planner, start, goal, PointToPoint())).subject
    motion = require_sound(
        planner,
        asked(planner, start, joints(planner, goal)),
        planner.plan(asked(planner, start, joints(planner, goal)), None),
    )
    assert Judge(planner.arm, planner.checker.newest.scene, is_drawn=True).touch(motion.positions) is None
