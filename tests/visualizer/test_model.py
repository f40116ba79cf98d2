"""The drawn arm is where the URDF says, and every mesh is closed and faces outwards."""

import math
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from hypothesis import given
from hypothesis import strategies as st

from gemelo.services.visualizer.model.mesh_files import mesh_path, missing_meshes
from gemelo.services.visualizer.model.rotations import multiply, quaternion, rotate
from gemelo.services.visualizer.model.triangle_meshes import primitive_mesh
from gemelo.services.visualizer.model.urdf import parse_urdf, tool_link
from gemelo.services.visualizer.model.visual_model import VisualShape


def joint(parent, child, more=""):
    """A joint in URDF."""
    ends = f"<parent link='{parent}'/><child link='{child}'/>"
    return f"<joint name='{parent}{child}' type='revolute'>{ends}{more}</joint>"


NAMES = ["brazo_joint", "antebrazo_joint", "efector_joint"]
angles = st.floats(-math.pi, math.pi)


def test_links_hang_below_each_other(model):
    assert model.root == "base_link"
    assert model.paths["efector_link"] == "base_link/brazo_link/antebrazo_link/efector_link"
    assert [joint.name for joint in model.moving] == NAMES


def test_the_tool_is_where_a_person_computes_it(model):
    rows = np.array([[0.0, 0.0, 0.0], [math.pi / 2, 0.0, 0.05]])
    link_positions = model.link_positions("efector_link", rows, NAMES)
    assert link_positions[0] == pytest.approx((0.40633, 0.00063, 0.18605), abs=1e-5)
    assert link_positions[1] == pytest.approx((-0.00063, 0.40633, 0.13605), abs=1e-4)


def test_poses_agree_with_yourdfpy(model, urdf_text, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text)
    reference = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    reference.update_cfg([0.7, -1.1, 0.03])
    expected = reference.get_transform("efector_link", "base_link")[:3, 3]
    found = model.link_positions("efector_link", np.array([[0.7, -1.1, 0.03]]), NAMES)
    assert found[0] == pytest.approx(expected, abs=1e-9)


@given(angles, angles, angles)
def test_roll_pitch_yaw_turn_about_fixed_axes(roll, pitch, yaw):
    point = np.array([0.3, -0.2, 0.5])
    x, y, z = (quaternion(*(angle if axis == k else 0.0 for k in range(3))) for axis, angle in
               enumerate((roll, pitch, yaw)))  # fmt: skip
    stepwise = rotate(z, rotate(y, rotate(x, point)))
    assert rotate(quaternion(roll, pitch, yaw), point) == pytest.approx(stepwise, abs=1e-12)
    assert np.linalg.norm(multiply(x, y)) == pytest.approx(1.0)


SHAPES = {
    "box": (VisualShape("box", (0.2, 0.1, 0.3)), 0.2 * 0.1 * 0.3),
    "cylinder": (VisualShape("cylinder", (0.05, 0.2)), math.pi * 0.05**2 * 0.2),
    "sphere": (VisualShape("sphere", (0.1,)), 4 / 3 * math.pi * 0.1**3),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_primitive_encloses_its_volume_with_its_faces_outwards(name):
    shape, volume = SHAPES[name]
    mesh = primitive_mesh(shape)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(volume, rel=0.02)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)


def test_a_margin_moves_every_surface_out():
    grown = primitive_mesh(VisualShape("box", (0.2, 0.1, 0.3)), margin=0.01).vertices
    assert np.ptp(grown, axis=0) == pytest.approx((0.22, 0.12, 0.32))


def test_mesh_files_are_found_in_the_robots_folder(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "a.glb").touch()
    model = parse_urdf(
        "<robot name='r'><link name='l'>"
        "<visual><geometry><mesh filename='package://rm1/meshes/a.glb'/></geometry></visual>"
        "<visual><geometry><mesh filename='meshes/b.glb'/></geometry></visual></link></robot>"
    )
    assert mesh_path(tmp_path, "package://rm1/meshes/a.glb") == tmp_path / "meshes" / "a.glb"
    assert missing_meshes(model, tmp_path) == ["meshes/b.glb"]


def test_a_mimic_joint_follows_and_a_fixed_one_stays():
    model = parse_urdf(
        "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>"
        "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/></joint>"
        "<joint name='m' type='prismatic'><parent link='b'/><child link='c'/><axis xyz='1 0 0'/>"
        "<mimic joint='j' multiplier='0.5' offset='0.1'/></joint>"
        "<joint name='f' type='fixed'><origin xyz='0 0 1'/><parent link='c'/><child link='d'/></joint></robot>"
    )
    assert [joint.name for joint in model.moving] == ["j"]
    assert model.link_positions("d", np.array([[math.pi]]), ["j"])[0] == pytest.approx(
        (-(math.pi / 2 + 0.1), 0.0, 1.0), abs=1e-12
    )


LINKS = "<link name='a'/><link name='b'/><link name='c'/>"


@pytest.mark.parametrize(
    ("urdf", "complaint"),
    [
        ("not xml", "not XML"),
        (f"<robot>{LINKS}" + joint("a", "b") + joint("b", "c") + joint("c", "b") + "</robot>", "hangs on two joints"),
        (f"<robot>{LINKS}" + joint("a", "b", "<mimic joint='x'/>") + joint("b", "c") + "</robot>", "mimics x"),
        (
            f"<robot>{LINKS}" + joint("a", "b", "<axis xyz='0 0'/>") + joint("b", "c") + "</robot>",
            '"0 0" must be three numbers',
        ),
        (
            f"<robot>{LINKS}" + joint("a", "b", "<axis xyz='0 0 z'/>") + joint("b", "c") + "</robot>",
            '"z" is not a number',
        ),
    ],
)
def test_a_urdf_that_cannot_be_drawn_is_refused_with_the_reason(urdf, complaint):
    with pytest.raises(ValueError, match=complaint):
        parse_urdf(urdf)


def test_two_roots_are_refused_by_name():
    with pytest.raises(ValueError, match="2 root links"):
        parse_urdf("<robot name='r'><link name='a'/><link name='b'/></robot>")


def test_the_tool_frame_is_the_robots_own_or_the_last_link(model):
    assert tool_link(model, 'tool_frame = "antebrazo_link"') == "antebrazo_link"
    assert tool_link(model, 'tool_frame = "nowhere"') == "efector_link"


def test_the_height_is_that_of_the_arm_with_every_joint_in_its_middle():
    """parol6's wrist, by the lengths of its links [mm]; lean and lift are its middles' distance from home."""
    model = parse_urdf((Path(__file__).parents[2] / "urdf/parol6/robot.urdf").read_text())
    lean, lift = np.radians(90.0 - 148.3838 / 2), np.radians((107.866 + 287.8675) / 2 - 180.0)
    pitch = lift - lean
    wrist = 110.5 + 180.0 * np.cos(lean) + 43.5 * np.cos(pitch) + 176.35 * np.sin(pitch)
    assert model.height == pytest.approx(wrist / 1000.0, abs=1e-6)
