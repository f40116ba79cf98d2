"""An arm that touches something is told the way out, and the way leads out; one that only stands near plans away."""

from __future__ import annotations

import re
import shlex

import numpy as np
import pytest

from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.jog.jog import PERIOD
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits
from gemelo.services.stepper_gateway.motion.target_tracker import TargetTracker
from gemelo.tools.cli.motion.jog import command_of
from tests.planner.jogging import Array, Jogged, arm_of, kinematics_of

ARMS, KINDS = ("rm1", "parol6"), ("itself", "a post", "what it carries")


def scene_of(kind: str, name: str) -> PlanningScene:
    """A post beside the arm; carried is a rod below the tool, with a floor that it may meet."""
    post = SceneObject(
        name="post", shape=BoxShape(size=(0.05, 0.05, 0.4)), pose=Transform(translation=(0.25, 0.18, 0.2))
    )
    rod = SceneObject(
        name="rod",
        shape=BoxShape(size=(0.02, 0.02, 0.06)),
        frame=arm_of(name).tool_frame,
        attached=True,
        touch_links=tuple(link.name for link in arm_of(name).model.links if link.name != "base_link"),
    )
    return PlanningScene(objects={"itself": (), "a post": (post,), "what it carries": (post, rod)}[kind])


def standing(world: World, kind: str, distance: float) -> Array:
    """A configuration at which the nearest two, of this kind, are so far [m] apart; below 0 inside one another."""
    random, joints = np.random.default_rng(5), world.arm.joints
    lower, upper = np.array([(joint.lower, joint.upper) for joint in joints]).T
    free = np.array(world.arm.named_states["ready"])
    assert world.distance(free) > CLEARANCE
    while True:
        way = np.linspace(free, random.uniform(lower, upper), 200)
        rows = np.array([world.distance(row) for row in way])
        crossed = np.flatnonzero(rows <= distance)
        if not len(crossed) or rows[crossed[0]] < -0.01:
            continue
        outer, inner = way[crossed[0] - 1], way[crossed[0]]
        for _ in range(40):
            middle = 0.5 * (outer + inner)
            outer, inner = (middle, inner) if world.distance(middle) > distance else (outer, middle)
        named = {name for pair in world.pairs_within(inner, max(distance, 0.0) + 1e-4) for name in pair}
        if {"itself": "post" not in named, "a post": "post" in named, "what it carries": "rod" in named}[kind]:
            return inner


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ARMS)
def test_who_stands_nearer_than_the_clearance_may_plan_away(name: str, kind: str):
    planner = planner_in(name, kind)
    configuration = standing(planner.checker.newest, kind, 0.0015)
    assert planner.checker.newest.distance(configuration) < CLEARANCE
    response = planner.plan(home_from(planner, configuration), None)
    assert response.code is PlanCode.SUCCESS, response.refusal


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ARMS)
def test_who_touches_is_told_how_to_jog_out_and_that_leads_out(name: str, kind: str):
    planner = planner_in(name, kind)
    world = planner.checker.newest
    configuration = standing(world, kind, -0.002)
    refused = planner.plan(home_from(planner, configuration), None)
    assert refused.code is PlanCode.START_STATE_IN_COLLISION
    assert refused.refusal is not None
    assert world.distance(refused.refusal.nearest_free) > CLEARANCE
    left = jogged_as_told(name, world, configuration, refused.refusal.remedy)
    assert world.distance(left) > 0.0
    assert planner.plan(home_from(planner, left), None).code is PlanCode.SUCCESS
    assert planner.plan(home_from(planner, configuration), None) == refused


def test_who_is_buried_is_told_of_no_way():
    planner = planner_in("rm1", "itself")
    room = SceneObject(name="room", shape=BoxShape(size=(3.0, 3.0, 3.0)))
    planner.set_world(World(planner.arm, planner.kinematics, PlanningScene(objects=(room,))))
    refused = planner.plan(home_from(planner, np.zeros(3)), None)
    assert refused.code is PlanCode.START_STATE_IN_COLLISION
    assert refused.refusal is not None
    assert refused.refusal.nearest_free == ()
    assert "gemelo jog" not in refused.refusal.remedy
    assert "gemelo scene remove room" in refused.refusal.remedy


def planner_in(name: str, kind: str) -> Planner:
    planner = Planner(arm_of(name), kinematics_of(name))
    planner.set_world(World(planner.arm, planner.kinematics, scene_of(kind, name)))
    return planner


def home_from(planner: Planner, configuration: Array) -> PlanRequest:
    start = JointState(name=planner.arm.joint_names, position=tuple(configuration.tolist()))
    return PlanRequest(start=start, goal=NamedGoal(name="ready"), allowed_time=20.0)


def jogged_as_told(name: str, world: World, configuration: Array, remedy: str) -> Array:
    """Where the arm comes to rest, by the jog and the tracker that run on a real one."""
    told = re.match(r"`gemelo jog --joint (.*) --for (\S+)` leads out, ", remedy)
    assert told, remedy
    jogged = Jogged(name, crowded=False)
    jogged.tracker = TargetTracker(Limits.of(jogged.arm.joints), PERIOD, Knot.at_rest(tuple(configuration.tolist())))
    jogged.world = world
    jogged.jog.set_world(world)
    command = command_of(arm_of(name), shlex.split(told[1]), (), (), False)
    for joint, velocity in zip(command.name, command.velocity, strict=True):
        assert abs(velocity) < jogged.arm.joint(joint).velocity
    jogged.hold(command, float(told[2]))
    jogged.let_go()
    return np.array(jogged.tracker.knot.position)
