"""rm1's own files: figures of the seed, meshes, and the pairs that the SRDF excuses."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes
from gemelo.services.planner.collision_geometry.shapes import ShapeKind
from gemelo.services.planner.collision_geometry.solids import Box, Cylinder
from tests.urdf.nearness import nearest_distances

SEED = {
    "antebrazo_joint": (0.20188, -0.00037, 0.15187),
    "efector_joint": (0.20445, 0.001, -0.13418),
}  # [m]; the sign of the last z is explained in the URDF


def test_the_origins_are_the_seeds(rm1: ArmDescription):
    for name, xyz in SEED.items():
        assert rm1.model.joint(name).origin.xyz == xyz
    assert rm1.model.joint("brazo_joint").origin.xyz == (0.0, 0.0, 0.0)


def test_forearm_and_effector_have_the_seeds_size(rm1: ArmDescription):
    sizes = {
        link.get("name"): box.get("size")
        for link in ET.parse(rm1.urdf_path).getroot().findall("link")
        for box in link.findall("collision/geometry/box")
    }
    assert sizes["antebrazo_link"] == "0.252 0.077 0.064"
    assert sizes["efector_link"] == "0.024 0.042 0.191"


def test_the_motors_are_wired_as_the_seeds(rm1: ArmDescription):
    """Wire name, driver, STEP, DIR, inverted, and the pulse width that q1's driver gets [us]."""
    wired = [
        (j.wire_name, j.driver.name, j.drive.motor.step_pin, j.drive.motor.dir_pin, j.drive.motor.inverted)
        for j in rm1.joints
    ]
    assert wired == [
        ("q1", "DM542T", 25, 27, False), ("q2", "A4988", 18, 19, True), ("q3", "A4988", 22, 23, False)
    ]  # fmt: skip
    assert rm1.joint("brazo_joint").driver.step_high_us == 5.0


def test_the_limits_are_the_seeds(rm1: ArmDescription):
    limits = [(joint.lower, joint.upper) for joint in rm1.joints]
    assert limits == [(-2.95, 2.95), (-2.95, 2.95), (0.0, 0.2)]
    assert [rm1.model.joint(joint.name).limit.velocity for joint in rm1.joints[:2]] == [1.57, 1.57]
    assert rm1.model.joint("efector_joint").origin.rpy == pytest.approx((3.1416, 0.0, 0.0), abs=1e-5)


def test_every_named_state_is_within_limits_and_free(rm1: ArmDescription):
    kinematics = Kinematics(rm1)
    assert {"home", "ready"} <= set(rm1.named_states)
    for configuration in rm1.named_states.values():
        assert all(joint.is_within(value) for joint, value in zip(rm1.joints, configuration, strict=True))
        assert kinematics.self_collisions(configuration, margin=0.004) == []


def test_base_and_forearm_never_come_near_and_the_checked_pairs_sometimes_touch(rm1: ArmDescription):
    """What the SRDF says, by sampling: "Never" is never, and what is checked is worth checking."""
    nearest = nearest_distances(rm1, configurations(rm1, 5000))
    assert nearest[frozenset(("base_link", "antebrazo_link"))] > 0.06
    assert nearest[frozenset(("base_link", "efector_link"))] < 0.0
    assert nearest[frozenset(("brazo_link", "efector_link"))] < 0.0


def configurations(arm: ArmDescription, count: int) -> np.ndarray:
    generator = np.random.default_rng(7)
    return generator.uniform([j.lower for j in arm.joints], [j.upper for j in arm.joints], (count, len(arm.joints)))


def test_the_meshes_load(rm1: ArmDescription):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import yourdfpy

        robot = yourdfpy.URDF.load(str(rm1.urdf_path))
        low, high = robot.scene.bounds
    assert (high - low).tolist() == pytest.approx((0.508, 0.18, 0.259), abs=0.01)


def test_what_is_drawn_lies_within_the_collision_shapes_but_for_screws_and_corners(rm1: ArmDescription):
    """A motor that can be seen and not be touched would go through what the planner keeps clear of."""
    solids = {
        ShapeKind.BOX: lambda size: Box(tuple(0.5 * edge for edge in size)),
        ShapeKind.CYLINDER: lambda size: Cylinder(size[0], 0.5 * size[1]),
    }
    for link, shapes in link_shapes(rm1).items():
        vertices = trimesh.load(rm1.folder / "meshes" / f"{link}.glb", force="mesh").vertices
        away = np.full(len(vertices), np.inf)
        for shape in shapes:
            inner = (vertices - shape.pose[0]) @ shape.rotation
            nearest = solids[shape.kind](shape.size).nearest(inner)
            away = np.minimum(away, np.linalg.norm(inner - nearest, axis=1))
        assert away.max() <= CLEARANCE + 1e-6, link  # GLB holds floats of 32 bits
