"""Meshes of many triangles: a look at them takes long, so few are taken, and the arm keeps clear all the same."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from gemelo.schemas.frames import Transform
from gemelo.schemas.planning import JogCommand
from gemelo.schemas.scene import MeshShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import MANY, World
from tests.planner.jogging import Array, Jogged, arm_of, kinematics_of

BANDS = 40  # 3200 triangles


def ball(radius: float, bands: int = BANDS) -> MeshShape:
    """An STL file of a ball [m]."""
    around, down = np.linspace(0.0, 2.0 * np.pi, bands + 1), np.linspace(0.0, np.pi, bands + 1)
    grid = radius * np.stack(
        (
            np.outer(np.sin(down), np.cos(around)),
            np.outer(np.sin(down), np.sin(around)),
            np.outer(np.cos(down), np.ones(bands + 1)),
        ),
        axis=-1,
    )
    corners = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    halves = [np.stack([corners[k] for k in half], axis=2).reshape(-1, 9) for half in ((0, 1, 2), (0, 2, 3))]
    triangles = np.concatenate(halves)
    assert len(triangles) > MANY
    facets = b"".join(struct.pack("<12fH", 0.0, 0.0, 0.0, *row, 0) for row in triangles)
    return MeshShape(data=b"\0" * 80 + struct.pack("<I", len(triangles)) + facets)


def world_with_ball(name: str, radius: float, place: tuple[float, ...]) -> World:
    thing = SceneObject(name="ball", shape=ball(radius), pose=Transform(translation=place))
    return World(arm_of(name), kinematics_of(name), PlanningScene(objects=(thing,)))


@pytest.mark.parametrize(
    ("name", "joint", "place"), [("rm1", "brazo_joint", (0.3, 0.25, 0.1)), ("parol6", "joint_1", (0.13, 0.22, 0.3))]
)
def test_driven_at_a_mesh_of_many_triangles_it_stops_at_the_clearance_and_may_come_away(
    name: str, joint: str, place: tuple[float, ...]
) -> None:
    jogged = Jogged(name, start="ready" if name == "parol6" else "home", crowded=False)
    jogged.world = world_with_ball(name, 0.06, place)
    jogged.jog.set_world(jogged.world)
    speed = 0.3 * jogged.arm.joint(joint).velocity
    jogged.hold(JogCommand(name=(joint,), velocity=(speed,)), 6.0)
    nearest = min(jogged.world.distance(knot.position) for knot in jogged.knots)
    assert CLEARANCE <= nearest < CLEARANCE + 0.004
    assert "ball" in jogged.limits()
    jogged.hold(JogCommand(name=(joint,), velocity=(-speed,)), 2.0)
    assert jogged.world.distance(jogged.commanded[-1]) > nearest + 0.02


def test_what_was_seen_before_changes_no_distance() -> None:
    """Of links that a closed mesh swallows, and lets go: no surface is near then, but the side has to be known."""
    scene = ((0.3, 0.0, 0.1), 0.35)
    seen = world_with_ball("rm1", scene[1], scene[0])
    joints = seen.arm.joints
    rng = np.random.default_rng(4)
    inside = 0
    for _ in range(12):
        ends = [np.array([rng.uniform(joint.lower, joint.upper) for joint in joints]) for _ in range(2)]
        for share in np.linspace(0.0, 1.0, 5):
            configuration: Array = (1.0 - share) * ends[0] + share * ends[1]
            distance = seen.distance(configuration)
            fresh = World(seen.arm, kinematics_of("rm1"), seen.scene)
            assert distance == pytest.approx(fresh.distance(configuration), abs=1e-5)
            inside += distance < -0.02
    assert inside > 3
