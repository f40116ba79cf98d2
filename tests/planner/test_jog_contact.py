"""An arm that touches something may be jogged out of the contact, slowly, and never deeper into it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.frames import Transform
from gemelo.schemas.planning import JogCommand
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject, SphereShape
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.jog import PERIOD
from gemelo.services.planner.jog.jog_obstacles import CONTACT_SPEED
from tests.planner.jogging import Array, Jogged, arm_of, kinematics_of
from tests.profiles import examples

ASTRAY = 0.0002  # [m] by which the gateway's tracker, which starts every joint on its own, leaves the jog's line
BLOCK = BoxShape(size=(0.05, 0.05, 0.05))


def world_with(name: str, shape: BoxShape | SphereShape, place: Array) -> World:
    thing = SceneObject(name="thing", shape=shape, pose=Transform(translation=tuple(place.tolist())))
    return World(arm_of(name), kinematics_of(name), PlanningScene(objects=(thing,)))


def touched(name: str, shape: BoxShape | SphereShape = BLOCK, aside: Array | None = None) -> Jogged:
    """An arm with something added where its tool is, and `aside` [m]."""
    jogged = Jogged(name, crowded=False)
    tool = jogged.kinematics.tool(jogged.tracker.knot.position).position
    jogged.world = world_with(name, shape, np.array(tool) + (0.0 if aside is None else aside))
    jogged.jog.set_world(jogged.world)
    return jogged


def depths(jogged: Jogged, displacement: Sequence[Sequence[float] | Array]) -> Array:
    """(periods, pairs) [m] between the shapes of every pair along a way."""
    numbers = range(len(jogged.world.pair_names))
    return np.array([jogged.world.distances(positions, numbers) for positions in displacement])


def require_never_deeper(jogged: Jogged) -> None:
    """What was nearer than the clearance never came nearer again than it had been left at."""
    for displacement, slack in ((jogged.commanded, 1e-5), ([knot.position for knot in jogged.knots], ASTRAY)):
        track = depths(jogged, displacement)
        won = np.maximum.accumulate(np.minimum(track, CLEARANCE), axis=0)
        assert np.all(track > won - slack), jogged.limits()


@pytest.mark.parametrize(("name", "aside"), [("rm1", 0.035), ("parol6", 0.04)])
def test_one_way_leads_out_of_a_contact_and_the_other_does_not_begin(name: str, aside: float) -> None:
    jogged = touched(name, aside=np.array([0.0, aside, 0.0]))
    assert jogged.world.distance(jogged.tracker.knot.position) < -0.01
    jogged.hold(JogCommand(linear=(0.0, 0.05, 0.0)), 0.5)
    assert not np.any(jogged.velocities)
    why = jogged.statuses[-1].limits[-1].why
    assert why is not None
    assert (why.code, why.values["second"]) == ("jog.limit.inside", "thing")
    assert why.values["depth"] == pytest.approx(0.014, abs=1e-3)
    jogged.hold(JogCommand(linear=(0.0, -0.05, 0.0)), 4.0)
    assert jogged.world.distance(jogged.commanded[-1]) > CLEARANCE
    jogged.let_go()
    require_never_deeper(jogged)


@pytest.mark.parametrize(("name", "aside"), [("rm1", 0.035), ("parol6", 0.04)])
def test_the_way_out_is_slow_until_the_clearance_is_won_and_it_is_said(name: str, aside: float) -> None:
    jogged = touched(name, aside=np.array([0.0, aside, 0.0]))
    jogged.hold(JogCommand(linear=(0.0, -0.1, 0.0)), 4.0)
    distances = np.array([jogged.world.distance(positions) for positions in jogged.commanded])
    within = distances < CLEARANCE
    speeds = [
        np.linalg.norm(jogged.kinematics.jacobian(p)[:3] @ v)
        for p, v in zip(jogged.commanded, jogged.velocities, strict=True)
    ]
    assert 10 < within.sum() < len(within)
    assert max(np.array(speeds)[within]) <= CONTACT_SPEED * 1.01
    assert max(np.array(speeds)[~within]) > 2.0 * CONTACT_SPEED
    first = jogged.statuses[0].limits[-1]
    assert (first.check, "thing" in first.subject) == ("contact", True)
    assert first.value is not None
    assert first.value < 0.0


def test_an_arm_that_cannot_go_the_shortest_way_out_may_go_along_the_surface() -> None:
    jogged = touched("rm1", aside=np.array([0.0, 0.0, 0.05]))  # in the forearm, which cannot come down
    jogged.hold(JogCommand(name=("brazo_joint",), velocity=(0.5,)), 9.0)
    assert jogged.world.distance(jogged.commanded[-1]) > CLEARANCE
    require_never_deeper(jogged)


def test_what_does_not_move_the_touching_link_is_free_to_move() -> None:
    jogged = Jogged("parol6", crowded=False)
    place = jogged.kinematics.link_poses(jogged.tracker.knot.position)["link_2"].translation
    jogged.world = world_with("parol6", BLOCK, np.array(place))
    jogged.jog.set_world(jogged.world)
    assert jogged.world.distance(jogged.tracker.knot.position) < 0.0
    last = jogged.arm.joint_names[-1]
    jogged.hold(JogCommand(name=(last,), velocity=(0.4,)), 0.5)
    assert jogged.velocities[-1][-1] == pytest.approx(0.4)


def test_an_object_that_appears_on_a_moving_arm_stops_it_and_lets_it_go_back() -> None:
    jogged = Jogged("rm1", crowded=False)
    turn = JogCommand(name=("brazo_joint",), velocity=(0.2,))
    jogged.hold(turn, 0.5)
    tool = np.array(jogged.kinematics.tool(jogged.tracker.knot.position).position)
    ahead = jogged.kinematics.jacobian(jogged.tracker.knot.position)[:3, 0]
    jogged.world = world_with("rm1", BLOCK, tool + 0.035 * ahead / np.linalg.norm(ahead))
    jogged.jog.set_world(jogged.world)
    jogged.hold(turn, 1.5)
    assert not np.any(jogged.velocities[-1])
    stood = jogged.world.distance(jogged.commanded[-1])
    jogged.hold(JogCommand(name=("brazo_joint",), velocity=(-0.5,)), 4.0)
    assert jogged.world.distance(jogged.commanded[-1]) > max(stood, CLEARANCE)


@pytest.mark.parametrize("name", ["rm1", "parol6"])
@examples(quick=5, full=10)
@given(
    aside=st.tuples(*[st.floats(-0.04, 0.04)] * 3),
    shape=st.sampled_from((BLOCK, SphereShape(radius=0.03))),
    ways=st.lists(st.tuples(*[st.floats(-0.1, 0.1)] * 3), min_size=1, max_size=3),
)
def test_no_command_leads_deeper(
    name: str, aside: tuple[float, ...], shape: BoxShape | SphereShape, ways: list[tuple[float, ...]]
) -> None:
    jogged = touched(name, shape, np.array(aside))
    for displacement in ways:
        jogged.hold(JogCommand(linear=displacement), 40 * PERIOD)
    jogged.let_go()
    require_never_deeper(jogged)
