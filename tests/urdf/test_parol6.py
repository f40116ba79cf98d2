"""parol6's own files: the DH table, figures of the seed, inertias, meshes, and the pairs that the SRDF excuses."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from fractions import Fraction
from functools import reduce
from itertools import combinations, pairwise, product
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.checks.check import check
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.motors.speed import speed_limits
from tests.profiles import examples
from tests.urdf.nearness import nearest_distances

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "parol6")
KINEMATICS = Kinematics(ARM)
LINKS = ("base_link", *(f"link_{number}" for number in range(1, 7)))
DH = (
    (110.5, 23.42, -90.0), (0.0, 180.0, 180.0), (0.0, -43.5, 90.0),
    (-176.35, 0.0, -90.0), (0.0, 0.0, 90.0), (-62.8, -45.25, 180.0),
)  # d, a [mm], alpha [deg]  # fmt: skip
LIMITS = (
    (-123.046875, 123.046875), (-145.0088, -3.375), (107.866, 287.8675),
    (-105.46975, 105.46975), (-90.0, 90.0), (0.0, 360.0),
)  # [deg]  # fmt: skip
STEPS_PER_TURN = (40960, 128000, Fraction(6400 * 380, 21), 25600, 25600, 64000)
STEPS_PER_SECOND = (15000, 25000, 32000, 10000, 10000, 27000)
MASSES = (0.813, 0.645, 0.512, 0.551, 0.393, 0.185, 0.070)  # [kg] base to L6
BOXES = (
    (227, 125, 71), (122, 238, 86), (77, 240, 193), (102, 107, 65), (86, 92, 194), (57, 98, 54), (82, 58, 40)
)  # [mm]  # fmt: skip
ANGLES = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in ARM.joints])


def dh_transform(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """Denavit and Hartenberg's Rz(theta) Tz(d) Tx(a) Rx(alpha), written out; [rad] and [m]."""
    ct, st_, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [[ct, -st_ * ca, st_ * sa, a * ct], [st_, ct * ca, -ct * sa, a * st_], [0, sa, ca, d], [0, 0, 0, 1]]
    )


def dh_tool(thetas: tuple[float, ...]) -> np.ndarray:
    links = [
        dh_transform(theta, d / 1000, a / 1000, np.radians(alpha))
        for theta, (d, a, alpha) in zip(thetas, DH, strict=True)
    ]
    return reduce(np.matmul, links)


@examples(full=500)
@given(ANGLES)
def test_the_tool_is_where_the_dh_table_puts_it(thetas: tuple[float, ...]):
    expected, pose = dh_tool(thetas), KINEMATICS.tool(thetas)
    assert np.abs(pose.position - expected[:3, 3]).max() < 1e-9
    assert np.abs(pose.rotation - expected[:3, :3]).max() < 1e-9


@examples(quick=30)
@given(ANGLES)
def test_the_light_chain_puts_it_there_too(thetas: tuple[float, ...]):
    """What state_publisher computes frames with."""
    position, _ = link_transforms(ARM.model, dict(zip(ARM.joint_names, thetas, strict=True)))["tool_link"]
    assert np.abs(position - dh_tool(thetas)[:3, 3]).max() < 1e-9


def test_the_arm_stands_upright_at_home_and_reaches_forward():
    """In mm: 23.42 + 176.35 + 62.8 forward, 110.5 + 180 + 43.5 - 45.25 up, the tool's z forward."""
    home = ARM.named_states["home"]
    assert np.degrees(home) == pytest.approx((0.0, -90.0, 180.0, 0.0, 0.0, 180.0))
    pose = KINEMATICS.tool(home)
    assert pose.position == pytest.approx((0.26257, 0.0, 0.28875), abs=1e-9)
    assert pose.rotation[:, 2] == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)
    assert ARM.reference_position == home


def test_the_home_of_the_other_api_is_within_limits_as_well():
    assert all(
        joint.is_within(angle)
        for joint, angle in zip(ARM.joints, np.radians((90.0, -90.0, 180.0, 0.0, 0.0, 180.0)), strict=True)
    )


def test_the_limits_are_the_mechanical_ones_and_the_urdf_is_not_beyond_them():
    for joint, (lower, upper) in zip(ARM.joints, np.radians(LIMITS), strict=True):
        assert (joint.drive.mechanical_lower, joint.drive.mechanical_upper) == pytest.approx((lower, upper), abs=1e-12)
        urdf = ARM.model.joint(joint.name).limit
        assert joint.drive.mechanical_lower <= urdf.lower < urdf.upper <= joint.drive.mechanical_upper


def test_steps_are_the_tables_exactly():
    assert tuple(joint.steps.steps_per_turn for joint in ARM.joints) == STEPS_PER_TURN


def test_speeds_are_the_tables_and_the_tick_can_do_them():
    for joint, rate in zip(ARM.joints, STEPS_PER_SECOND, strict=True):
        assert float(speed_limits(joint.drive).step_rate) == pytest.approx(rate, rel=1e-15)
        assert joint.velocity == pytest.approx(rate / joint.steps.per_unit, rel=1e-12)
        assert rate <= 0.8 * ARM.device.tick_hz / 2


def test_the_wires_are_called_as_in_the_serial_protocol():
    assert [joint.wire_name for joint in ARM.joints] == ["J1", "J2", "J3", "J4", "J5", "J6"]


def test_every_link_has_the_inertia_of_a_solid_box_of_its_size_and_mass():
    for link, mass, size in zip(ARM.model.links, MASSES, BOXES, strict=False):
        ixx, ixy, ixz, iyy, iyz, izz = link.inertial.inertia
        assert (link.inertial.mass, ixy, ixz, iyz) == (mass, 0.0, 0.0, 0.0)
        # What is left of the moments when two are added and the third is taken away is one side's square.
        squares = [6 / mass * (a + b - c) for a, b, c in ((iyy, izz, ixx), (ixx, izz, iyy), (ixx, iyy, izz))]
        assert sorted(1000 * np.sqrt(squares)) == pytest.approx(sorted(size), rel=1e-4)


def test_every_link_has_collision_shapes_as_large_as_its_box():
    for link, size in zip(LINKS, BOXES, strict=True):
        low, high = shape_bounds()[link]
        assert sorted(1000 * (high - low)) == pytest.approx(sorted(size), abs=0.01), link


def test_no_collision_shape_is_left_out():
    """A shape that pinocchio cannot read is left out in silence."""
    written = ET.parse(ARM.urdf_path).getroot().findall("link/collision")
    assert KINEMATICS.collisions.geometry_count == len(written) == 21


def shape_bounds() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The least and the greatest corner [m] of every link's collision shapes, in the link's frame."""
    model = pin.buildModelFromUrdf(str(ARM.urdf_path))
    geometry = pin.buildGeomFromUrdf(model, str(ARM.urdf_path), pin.GeometryType.COLLISION)
    corners: dict[str, list[np.ndarray]] = {}
    for shape in geometry.geometryObjects:
        shape.geometry.computeLocalAABB()
        box = shape.geometry.aabb_local
        local = np.array(list(product(*zip(box.min_, box.max_, strict=True))))
        turned = local @ shape.placement.rotation.T + shape.placement.translation
        corners.setdefault(model.frames[shape.parentFrame].name, []).append(turned)
    return {link: (np.vstack(points).min(axis=0), np.vstack(points).max(axis=0)) for link, points in corners.items()}


def test_every_named_state_is_within_limits_and_free():
    assert {"home", "rest", "ready"} <= set(ARM.named_states)
    for name, configuration in ARM.named_states.items():
        assert all(joint.is_within(value) for joint, value in zip(ARM.joints, configuration, strict=True))
        assert KINEMATICS.self_collisions(configuration, margin=0.01) == [], name


def test_excused_pairs_never_come_near_and_checked_pairs_sometimes_touch():
    """What the SRDF says, by sampling: "Never" is never, and what is checked is worth checking."""
    nearest = nearest_distances(ARM, configurations(4000))
    never = {frozenset(p) for p in combinations(LINKS, 2)} - {frozenset(p) for p in pairwise(LINKS)}
    checked = {pair for pair in never if pair not in ARM.disabled_collisions}
    assert {frozenset(pair) for pair in KINEMATICS.collisions.pairs} == checked
    assert {tuple(sorted(pair)) for pair in never - checked if nearest[pair] < 0.005} == set()
    assert {tuple(sorted(pair)) for pair in checked if nearest[pair] > 0.0} == set()


def configurations(count: int) -> np.ndarray:
    """(count, n) at random, every other one with some joints at a limit."""
    generator = np.random.default_rng(7)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in ARM.joints]).T
    inside = generator.uniform(lower, upper, (count, len(lower)))
    at_limit = (generator.random(inside.shape) < 0.3) & (np.arange(count) % 2 == 0)[:, None]
    return np.where(at_limit, np.where(generator.random(inside.shape) < 0.5, lower, upper), inside)


def test_the_check_finds_nothing():
    assert check(ARM.folder) == []


def test_the_meshes_are_drawn_within_the_links_shapes():
    shapes = shape_bounds()
    for link in LINKS:
        low, high = trimesh.load(ARM.folder / "meshes" / f"{link}.glb").bounds
        assert (low > shapes[link][0] - 1e-3).all(), link
        assert (high < shapes[link][1] + 1e-3).all(), link


def test_the_readme_shows_the_dh_table():
    text = (ARM.folder / "README.md").read_text()
    for number, (d, a, alpha) in enumerate(DH, 1):
        assert f"| {number} | {d:g} | {a:g} | {alpha:g} |" in text
