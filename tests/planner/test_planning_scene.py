"""Planning among objects: refusals name them, and what is no longer there is in nobody's way."""

from __future__ import annotations

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest, PointToPoint, PoseGoal
from gemelo.schemas.scene import AllowedPair, BoxShape, PlanningScene, SceneObject, SphereShape
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner

GOAL = JointGoal(name=("brazo_joint",), position=(1.2,))
REQUEST = PlanRequest(goal=GOAL, motion=PointToPoint())


@pytest.fixture
def planner(rm1: ArmDescription) -> Planner:
    return Planner(rm1)


def scene(*objects: SceneObject, allowed: tuple[AllowedPair, ...] = (), version: int = 7) -> PlanningScene:
    return PlanningScene(objects=objects, allowed=allowed, version=version)


def block(planner: Planner, turn: float, name: str = "block") -> SceneObject:
    """A small box where the tool is when the arm is turned by `turn` [rad]."""
    at = planner.kinematics.tool((turn, 0.0, 0.0)).position.tolist()
    return SceneObject(name=name, shape=BoxShape(size=(0.04, 0.04, 0.04)), pose=Transform(translation=tuple(at)))


def show(planner: Planner, shown: PlanningScene) -> None:
    planner.set_world(World(planner.arm, planner.kinematics, shown))


def test_a_way_through_a_box_is_refused_by_its_name_and_free_without_it(planner: Planner, home: JointState) -> None:
    show(planner, scene(block(planner, 0.6)))
    refused = planner.plan(REQUEST, home)
    assert refused.code is PlanCode.PLANNING_FAILED
    assert refused.refusal is not None
    assert refused.refusal.check == "collision"
    assert "with box block" in refused.refusal.message
    assert refused.refusal.subject.endswith("/ block")
    assert 0.0 < refused.refusal.configuration[0] < 0.6
    assert refused.scene_version == 7
    show(planner, scene(version=8))
    free = planner.plan(REQUEST, home)
    assert free.code is PlanCode.SUCCESS
    assert free.scene_version == 8


def test_a_goal_in_a_box_is_refused_with_the_last_configuration_before_it(planner: Planner, home: JointState) -> None:
    show(planner, scene(block(planner, 1.2)))
    response = planner.plan(REQUEST, home)
    assert response.code is PlanCode.GOAL_IN_COLLISION
    assert response.refusal is not None
    assert "box block" in response.refusal.message
    nearer = PlanRequest(
        goal=JointGoal(name=("brazo_joint",), position=response.refusal.nearest), motion=PointToPoint()
    )
    assert planner.plan(nearer, home).code is PlanCode.SUCCESS


def test_an_arm_that_stands_in_an_object_is_told_which_and_what_to_do(planner: Planner, home: JointState) -> None:
    show(planner, scene(block(planner, 0.0)))
    response = planner.plan(REQUEST, home)
    assert response.code is PlanCode.START_STATE_IN_COLLISION
    assert response.refusal is not None
    assert "box block" in response.refusal.message
    assert "gemelo scene remove block" in response.refusal.remedy


def test_an_arm_just_beside_an_object_may_come_away_from_it(planner: Planner, home: JointState) -> None:
    """Nearer than the clearance, but not touching: it may leave, and may not come nearer."""
    world = World(planner.arm, planner.kinematics, scene(block(planner, -0.4)))
    gap = world.distance((0.0, 0.0, 0.0))
    wide = SceneObject(
        name="block", shape=BoxShape(size=(0.04, 0.04, 0.04)), pose=block(planner, -0.4).pose, padding=gap - 0.002
    )
    show(planner, scene(wide))
    assert 0.0 < planner.checker.newest.distance((0.0, 0.0, 0.0)) < 0.004
    assert planner.plan(REQUEST, home).code is PlanCode.SUCCESS
    towards = PlanRequest(goal=JointGoal(name=("brazo_joint",), position=(-0.3,)), motion=PointToPoint())
    assert planner.plan(towards, home).code is not PlanCode.SUCCESS


def test_what_the_arm_carries_is_kept_clear_too(planner: Planner, home: JointState) -> None:
    beam = SceneObject(
        name="beam",
        shape=BoxShape(size=(0.4, 0.02, 0.02)),
        pose=Transform(translation=(0.25, 0.0, 0.0)),
        frame=planner.arm.tool_frame,
        attached=True,
    )
    x, y, z = planner.kinematics.tool((0.6, 0.0, 0.0)).position.tolist()
    post = SceneObject(name="post", shape=SphereShape(radius=0.02), pose=Transform(translation=(1.6 * x, 1.6 * y, z)))
    show(planner, scene(post))
    assert planner.plan(REQUEST, home).code is PlanCode.SUCCESS
    show(planner, scene(post, beam))
    refused = planner.plan(REQUEST, home)
    assert refused.refusal is not None
    assert (
        "box beam with sphere post" in refused.refusal.message or "sphere post with box beam" in refused.refusal.message
    )
    show(planner, scene(post, beam, allowed=(AllowedPair(first="beam", second="post"),)))
    assert planner.plan(REQUEST, home).code is PlanCode.SUCCESS


@pytest.mark.parametrize("turn", [0.6, -0.6])
def test_an_object_that_comes_while_a_plan_is_made_stops_the_plan_it_is_in_the_way_of(
    planner: Planner, home: JointState, turn: float
) -> None:
    newer = World(planner.arm, planner.kinematics, scene(block(planner, turn), version=9))

    def clock() -> float:  # is looked at all the while
        planner.set_world(newer)
        return 0.0

    response = planner.plan(REQUEST, home, clock=clock)
    assert response.scene_version == 9
    if turn > 0.0:
        assert response.refusal is not None
        assert "as it has become meanwhile" in response.refusal.message
        assert "box block" in response.refusal.message
    else:
        assert response.code is PlanCode.SUCCESS


def test_an_object_on_the_way_does_not_change_how_far_the_arm_reaches(planner: Planner, home: JointState) -> None:
    beyond = PlanRequest(goal=PoseGoal(position=(0.1, 0.6, 0.1)))
    alone = planner.plan(beyond, home).refusal
    wall = SceneObject(name="wall", shape=BoxShape(size=(0.02, 0.02, 1.0)), pose=block(planner, 0.4).pose)
    show(planner, scene(wall, block(planner, 0.7), block(planner, 1.0, "another")))
    blocked = planner.plan(beyond, home).refusal
    assert alone is not None
    assert blocked is not None
    assert blocked.value == pytest.approx(alone.value)
    assert blocked.nearest == pytest.approx(alone.nearest)
