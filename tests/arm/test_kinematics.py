"""Kinematics held against yourdfpy, finite differences and the light chain; self-collisions."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import from_message
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from tests.profiles import examples

RM1 = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
KINEMATICS = Kinematics(RM1)
CONFIGURATIONS = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in RM1.joints])


@pytest.fixture(scope="module")
def peer() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import yourdfpy

        return yourdfpy.URDF.load(str(RM1.urdf_path), load_meshes=False)


def test_every_link_is_where_yourdfpy_has_it(peer: Any):
    generator = np.random.default_rng(2)
    for _ in range(100):
        q = generator.uniform([j.lower for j in RM1.joints], [j.upper for j in RM1.joints])
        peer.update_cfg(dict(zip(RM1.joint_names, q, strict=True)))
        poses = KINEMATICS.link_poses(q)
        for link in RM1.model.link_names:
            theirs = peer.get_transform(link, "base_link")
            assert np.allclose(poses[link].translation, theirs[:3, 3], atol=1e-9)
        assert np.allclose(KINEMATICS.tool(q).position, theirs[:3, 3], atol=1e-9)
        assert np.allclose(KINEMATICS.tool(q).rotation, theirs[:3, :3], atol=1e-9)


@given(CONFIGURATIONS)
def test_the_light_chain_agrees_with_pinocchio(q: tuple[float, ...]):
    poses = KINEMATICS.link_poses(q)
    for name, (point, turn) in link_transforms(RM1.model, dict(zip(RM1.joint_names, q, strict=True))).items():
        assert point == pytest.approx(poses[name].translation, abs=1e-12)
        assert abs(float(np.dot(turn, from_message(poses[name])[1]))) == pytest.approx(1.0, abs=1e-12)


@given(CONFIGURATIONS)
def test_the_jacobian_is_the_finite_difference(q: tuple[float, ...]):
    jacobian, h = KINEMATICS.jacobian(q), 1e-6
    for column in range(len(q)):
        ahead, behind = (np.array(q) + sign * h * np.eye(len(q))[column] for sign in (1, -1))
        slope = (KINEMATICS.tool(ahead).position - KINEMATICS.tool(behind).position) / (2 * h)
        assert np.allclose(jacobian[:3, column], slope, atol=1e-8)
        spin = KINEMATICS.tool(ahead).rotation @ KINEMATICS.tool(behind).rotation.T
        assert np.allclose(jacobian[3:, column], np.array([spin[2, 1], spin[0, 2], spin[1, 0]]) / (2 * h), atol=1e-8)


def test_travel_lifts_the_tool_which_is_below_the_forearm():
    low, high = KINEMATICS.tool((0.0, 0.0, 0.0)).position, KINEMATICS.tool((0.0, 0.0, 0.2)).position
    assert low == pytest.approx((0.40633, 0.00063, 0.01769), abs=1e-9)
    assert high - low == pytest.approx((0.0, 0.0, 0.2), abs=1e-12)
    assert low[2] < KINEMATICS.link_poses((0.0, 0.0, 0.0))["antebrazo_link"].translation[2]


def test_all_collision_shapes_are_there():
    assert KINEMATICS.collisions.geometry_count == 11
    assert set(KINEMATICS.collisions.pairs) == {("base_link", "efector_link"), ("brazo_link", "efector_link")}


def test_a_folded_arm_touches_itself_and_says_with_what():
    assert KINEMATICS.self_collisions((0.0, 2.9, 0.0)) == [
        ("base_link", "efector_link"),
        ("brazo_link", "efector_link"),
    ]
    assert KINEMATICS.self_collisions((0.0, 1.0, 0.0)) == []


def test_a_margin_sees_what_is_only_near():
    assert KINEMATICS.self_collisions((0.0, 0.0, 0.0), margin=1.0)
    assert KINEMATICS.collisions.distance((0.0, 0.0, 0.0)) > 0.1


@examples(full=200)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_no_distance_changes_faster_than_the_reach_says(a: tuple[float, ...], b: tuple[float, ...]):
    moved = float(np.abs(np.subtract(a, b)) @ KINEMATICS.collisions.reach)
    change = abs(KINEMATICS.collisions.distance(a) - KINEMATICS.collisions.distance(b))
    assert change <= moved + 1e-5  # coal's GJK ends within some 1e-6 m, depending on where it began


def test_a_shape_that_pinocchio_drops_is_an_error_and_not_free_space(rm1_folder: Path, tmp_path: Path):
    folder = Path(shutil.copytree(rm1_folder, tmp_path / "rm1"))
    text = (folder / "robot.urdf").read_text()
    (folder / "robot.urdf").write_text(text.replace("<cylinder", "<capsule"))
    with pytest.raises((DescriptionError, ValueError), match=r"collision shapes|capsule"):
        Kinematics(load_arm(folder))


def test_the_wrong_number_of_joints_is_an_error(rm1: ArmDescription):
    with pytest.raises(ValueError, match="3 joints"):
        KINEMATICS.tool((0.0, 0.0))


def test_continuous_and_mimicking_joints_and_a_base_below_the_root(tmp_path: Path):
    folder = arm_with_everything(tmp_path)
    arm = load_arm(folder)
    kinematics = Kinematics(arm)
    q = (4.0, 0.3)
    known = dict(zip(arm.joint_names, q, strict=True))
    poses = link_transforms(arm.model, known)
    found = kinematics.link_poses(q)
    assert found["base"].translation == (0.0, 0.0, 0.0)
    assert np.allclose(np.add(found["tip"].translation, (0.0, 0.0, 0.5)), poses["tip"][0], atol=1e-12)
    h = 1e-6
    for column in range(2):
        step = h * np.eye(2)[column]
        slope = (kinematics.tool(np.array(q) + step).position - kinematics.tool(np.array(q) - step).position) / (2 * h)
        assert np.allclose(kinematics.jacobian(q)[:3, column], slope, atol=1e-8)


def arm_with_everything(folder: Path) -> Path:
    """A root below the base, a continuous joint that is listed second, and a joint that mimics it."""
    shape = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    links = "".join(f'<link name="{name}">{shape}</link>' for name in ("root", "base", "one", "two", "tip"))
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}"/>{5}</joint>'
    limit = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>'
    joints = (
        joint.format("stand", "fixed", "root", "base", "0 0 0.5", "")
        + joint.format("second", "revolute", "base", "one", "0.1 0 0", limit)
        + joint.format("first", "continuous", "one", "two", "0.2 0 0", limit)
        + joint.format("third", "revolute", "two", "tip", "0.3 0 0", limit + '<mimic joint="second" multiplier="-2"/>')
    )
    (folder / "robot.urdf").write_text(f'<robot name="all">{links}{joints}</robot>')
    (folder / "robot.srdf").write_text('<robot name="all"><group name="arm"/></robot>')
    drive = '[[joint]]\nname = "{0}"\nwire_name = "{0}"\n[joint.motor]\ndriver = "d"\npulses_per_turn = 400\n'
    (folder / "robot.toml").write_text(
        'name = "all"\nbase_frame = "base"\ntool_frame = "tip"\n[device]\nname = "all"\n'
        '[[driver]]\nname = "d"\nstep_high_us = 1.0\nstep_low_us = 1.0\ndir_setup_us = 1.0\n'
        + drive.format("first")
        + drive.format("second")
    )
    return folder
