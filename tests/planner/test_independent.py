"""The judge of the planner is no blind one: it sees what geometry says, and what coal says."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanRequest
from gemelo.schemas.scene import (
    AllowedPair,
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    Shape,
    SphereShape,
)
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from tests.planner.independent import Judge, resampled
from tests.planner.native.scenes import star_mesh
from tests.table import table

ARMS = {name: load_arm(Path(__file__).parents[2] / "urdf" / name) for name in ("rm1", "parol6")}
HOME = np.zeros(3)  # of rm1: its effector is a box of 24 x 42 x 191 mm in front, its tip 0.0177 m above the floor
FRONT, TIP = 0.20188 + 0.20445 + 0.012, 0.15187 - 0.13418  # [m]
SAME = 3e-6  # [m] by which coal and MuJoCo may tell one distance


def item(name: str, shape: Shape, place: tuple[float, float, float], **more: object) -> SceneObject:
    return SceneObject(name=name, shape=shape, pose=Transform(translation=place), **more)


def stl(size: float) -> bytes:
    """A cube from its own corners, whole edges of `size` [m]."""
    corners = 0.5 * size * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([[a, b, c] for a, b, c, _ in quads] + [[a, c, d] for a, _, c, d in quads])
    return content_of(corners, faces)


def content_of(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """A binary STL file."""
    facets = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    facets["corners"] = vertices[faces]
    return bytes(80) + struct.pack("<I", len(facets)) + facets.tobytes()


def in_front(gap: float) -> dict[str, SceneObject]:
    """One of each shape, `gap` [m] from the front of rm1's effector at home, or from its tip."""
    x, height = FRONT + gap, 0.08
    return {
        "box": item("it", BoxShape(size=(0.1, 0.1, 0.1)), (x + 0.05, 0.0, height)),
        "sphere": item("it", SphereShape(radius=0.05), (x + 0.05, 0.0, height)),
        "cylinder": item("it", CylinderShape(radius=0.05, length=0.2), (x + 0.05, 0.0, height)),
        "mesh": item("it", MeshShape(data=stl(0.1)), (x + 0.05, 0.0, height)),
        "plane": item("it", PlaneShape(), (0.0, 0.0, TIP - gap)),
    }


@table("shape", in_front(0.0))
@table("gap", [0.03, 0.0005, -0.0005, -0.005])
def test_a_distance_that_geometry_knows_is_told_and_a_contact_is_found(shape: str, gap: float):
    """The floor plane is under the base too, which stands on it by design and never moves."""
    judge = Judge(ARMS["rm1"], PlanningScene(objects=(in_front(gap)[shape],)))
    found = judge.nearest(HOME)
    assert found.distance == pytest.approx(gap, abs=SAME)
    assert {found.first, found.second} == {"efector_link", "it"}
    assert (judge.touch(HOME[None, :]) is not None) == (gap < 0.0)


def test_padding_is_taken_off_the_distance():
    padded = item("it", SphereShape(radius=0.05), (FRONT + 0.08, 0.0, 0.08), padding=0.02)
    assert Judge(ARMS["rm1"], PlanningScene(objects=(padded,))).nearest(HOME).distance == pytest.approx(0.01, abs=SAME)


def test_what_the_arm_carries_is_looked_at_with_the_arm_and_with_what_stands_around():
    """A ball of 2 cm at 10 cm in front of the effector, and a wall 5 cm before it."""
    ball = item("ball", SphereShape(radius=0.02), (0.012 + 0.1, 0.0, 0.0), frame="efector_link", attached=True)
    wall = item("wall", BoxShape(size=(0.1, 1.0, 1.0)), (FRONT + 0.1 + 0.02 + 0.05 + 0.05, 0.0, 0.5))
    judge = Judge(ARMS["rm1"], PlanningScene(objects=(ball, wall)))
    assert judge.nearest(HOME).distance == pytest.approx(0.05, abs=SAME)
    turned = np.array([math.pi / 2, 0.0, 0.0])
    assert judge.nearest(turned).distance > 0.06  # the wall is behind, the ball is with the arm
    assert frozenset(("ball", "efector_link")) not in judge.pairs
    assert frozenset(("ball", "base_link")) in judge.pairs


def test_only_what_is_excused_is_not_looked_at():
    crate = item("crate", BoxShape(size=(0.1, 0.1, 0.1)), (0.4, 0.0, 0.05))
    scene = PlanningScene(objects=(crate,))
    assert Judge(ARMS["rm1"], scene).pairs == {
        *(frozenset(("crate", link)) for link in ("brazo_link", "antebrazo_link", "efector_link")),
        *(frozenset(("efector_link", link)) for link in ("base_link", "brazo_link")),
    }
    allowed = PlanningScene(objects=(crate,), allowed=(AllowedPair(first="*", second="crate"),))
    assert Judge(ARMS["rm1"], allowed).pairs == Judge(ARMS["rm1"]).pairs
    assert len(Judge(ARMS["parol6"]).pairs) == len(World(ARMS["parol6"], Kinematics(ARMS["parol6"])).pairs)


def test_a_touch_of_a_moment_is_found_in_a_long_way():
    """Around once, past a bead of a tenth of a millimetre, that only a few rows touch."""
    bead = item("bead", SphereShape(radius=1e-4), (0.0, FRONT - 0.0005, 0.08))
    judge = Judge(ARMS["rm1"], PlanningScene(objects=(bead,)))
    rows = np.column_stack((np.linspace(0.0, 2.9, 20_000), np.zeros(20_000), np.zeros(20_000)))
    touch = judge.touch(rows)
    assert touch is not None
    assert {touch.first, touch.second} == {"efector_link", "bead"}
    beyond = item("bead", SphereShape(radius=1e-4), (0.0, math.hypot(FRONT, 0.021) + 0.0005, 0.08))
    assert Judge(ARMS["rm1"], PlanningScene(objects=(beyond,))).touch(rows) is None


@pytest.mark.parametrize("name", ARMS)
def test_it_has_the_tool_where_pinocchio_has_it(name: str):
    arm, judge, kinematics = ARMS[name], Judge(ARMS[name]), Kinematics(ARMS[name])
    for row in configurations(arm, 200):
        position, rotation = judge.tool(row)
        assert position == pytest.approx(kinematics.tool(row).position, abs=1e-12)
        assert rotation == pytest.approx(kinematics.tool(row).rotation, abs=1e-12)


@pytest.mark.parametrize("name", ARMS)
def test_it_and_coal_tell_the_same_distances(name: str):
    arm, kinematics = ARMS[name], Kinematics(ARMS[name])
    random = np.random.default_rng(3)
    mesh = star_mesh(random)
    touches = 0
    for _ in range(4):
        place = [tuple(random.uniform((-0.4, -0.4, 0.05), (0.4, 0.4, 0.5)).tolist()) for _ in range(4)]
        scene = PlanningScene(
            objects=(
                item("box", BoxShape(size=tuple(random.uniform(0.02, 0.2, 3).tolist())), place[0], padding=0.01),
                item("ball", SphereShape(radius=0.06), place[1]),
                item("drum", CylinderShape(radius=0.04, length=0.2), place[2]),
                item("rock", MeshShape(data=content_of(mesh.vertices, mesh.faces)), place[3]),
                item("held", BoxShape(size=(0.05, 0.03, 0.2)), (0.0, 0.0, 0.0), frame=arm.tool_frame, attached=True,
                     touch_links=tuple(link.name for link in arm.model.links)),
                item("floor", PlaneShape(), (0.0, 0.0, -0.3)),
            ),
            allowed=(AllowedPair(first="box", second="ball"),),
        )  # fmt: skip
        world, judge = World(arm, kinematics, scene), Judge(arm, scene)
        for row in configurations(arm, 150):
            told, judged = world.distance(row), judge.nearest(row).distance
            touches += told <= 0.0
            assert (told <= 0.0) == (judged <= 0.0)
            assert told <= 0.0 or judged == pytest.approx(told, abs=SAME)
    assert 50 < touches < 550


@pytest.mark.parametrize("name", ARMS)
def test_a_drawn_arm_is_about_as_large_as_its_shapes(name: str):
    """So the drawn judge is not blind either."""
    crate = item("crate", BoxShape(size=(0.2, 0.2, 0.2)), (0.3, 0.0, 0.15))
    scene = PlanningScene(objects=(crate,))
    shapes, drawn = Judge(ARMS[name], scene), Judge(ARMS[name], scene, is_drawn=True)
    rows = configurations(ARMS[name], 300)
    both = np.array([(shapes.nearest(row).distance, drawn.nearest(row).distance) for row in rows])
    assert 10 < (both[:, 1] <= 0.0).sum() < 290
    free = both.min(axis=1) > 0.0
    assert np.abs(np.diff(both[free], axis=1)).max() < 0.03
    assert drawn.pairs == shapes.pairs


def test_its_quintics_are_those_that_the_gateway_plays():
    arm = ARMS["rm1"]
    goal = JointGoal(name=arm.joint_names, position=(1.0, -0.5, 0.1))
    start = JointState(name=arm.joint_names, position=tuple(HOME.tolist()))
    trajectory = Planner(arm).plan(PlanRequest(goal=goal, start=start), None).trajectory
    motion, sampler = resampled(trajectory, 7), TrajectorySampler(trajectory)
    assert len(motion.times) == 7 * (len(trajectory.points) - 1) + 1
    for index, t in enumerate(motion.times.tolist()):
        position, velocity, acceleration = sampler.at(t)
        assert motion.positions[index] == pytest.approx(position, abs=1e-10)
        assert motion.velocities[index] == pytest.approx(velocity, abs=1e-8)
        assert motion.accelerations[index] == pytest.approx(acceleration, abs=1e-6)


def configurations(arm: ArmDescription, count: int) -> np.ndarray:
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    return np.random.default_rng(5).uniform(lower, upper, (count, len(lower)))
