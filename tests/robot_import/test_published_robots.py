"""Traps of robots as people publish them: bases that drive, followers of followers, foreign attributes, layouts."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.source import find_source
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.exports import LIMIT, joint, link, mesh, package, write

BASE = ('<link name="ground"/>', '<link name="base"/>', '<link name="arm"/>')


def mended(path: Path, *parts: str) -> Mended:
    """A URDF of these parts at `path`, as an import reads it."""
    return mend(find_source(write(path, "robot", *parts)))


def errors(found: Mended) -> list[str]:
    return [str(each) for each in found.findings() if str(each).startswith("error")]


@pytest.mark.parametrize(("kind", "word"), [("planar", "drives"), ("floating", "is free to move")])
def test_a_base_that_drives_or_is_free_stands_still(tmp_path: Path, kind: str, word: str):
    free = joint("free", "ground", "base", kind=kind, rest='<limit lower="-2" upper="2" effort="9" velocity="1"/>')
    found = mended(tmp_path / "robot.urdf", *BASE, free, joint("turn", "base", "arm"))
    assert errors(found) == []
    assert [each.kind for each in found.model.joints] == [JointKind.FIXED, JointKind.REVOLUTE]
    (said,) = (str(each) for each in found.findings() if 'joint "free"' in str(each))
    assert word in said
    assert said.startswith("warning")


def test_a_planar_joint_within_the_arm_is_an_error(tmp_path: Path):
    parts = (joint("turn", "ground", "base"), joint("plane", "base", "arm", kind="planar"))
    (said,) = errors(mended(tmp_path / "robot.urdf", *BASE, *parts))
    assert 'joint "plane": type "planar"' in said


def test_a_follower_of_a_follower_follows_the_joint_with_the_motor(tmp_path: Path):
    parts = [
        joint("one", "ground", "base"),
        joint("two", "base", "arm", rest=f'{LIMIT}<mimic joint="one" multiplier="-2" offset="0.1"/>'),
        joint("three", "arm", "tip", rest=f'{LIMIT}<mimic joint="two" multiplier="3" offset="0.5"/>'),
    ]
    found = mended(tmp_path / "robot.urdf", *BASE, '<link name="tip"/>', *parts)
    mimic = found.model.joint("three").mimic
    assert errors(found) == []
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("one", -6.0, 0.8)


def test_followers_in_a_ring_are_an_error(tmp_path: Path):
    parts = [
        joint("one", "ground", "base", rest=f'{LIMIT}<mimic joint="two"/>'),
        joint("two", "base", "arm", rest=f'{LIMIT}<mimic joint="one"/>'),
    ]
    assert any("follows another itself" in each for each in errors(mended(tmp_path / "robot.urdf", *BASE, *parts)))


def test_a_joint_that_follows_itself_is_told_so(tmp_path: Path):
    parts = (joint("one", "ground", "base", rest=f'{LIMIT}<mimic joint="one"/>'), joint("two", "base", "arm"))
    (said,) = errors(mended(tmp_path / "robot.urdf", *BASE, *parts))
    assert 'joint "one": mimics itself -> name the joint that has the motor' in said


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ('<box size="-0.05 0.05 0.1"/>', '`size` of <box> is "-0.05 0.05 0.1", not 3 numbers above 0'),
        ('<box size="0.05 0.05"/>', '`size` of <box> is "0.05 0.05", not 3 numbers above 0'),
        ('<cylinder radius="0.05" length="0"/>', '`length` of <cylinder> is "0", not a number above 0'),
        ('<cylinder radius="0.05"/>', "attribute `length` of <cylinder> is missing"),
        ('<sphere radius="nan"/>', '`radius` of <sphere> is "nan", not a number above 0'),
    ],
)
def test_a_shape_that_has_no_size_is_an_error_with_its_line(tmp_path: Path, shape: str, words: str):
    drawn = f'<link name="base"><visual><geometry>{shape}</geometry></visual></link>'
    parts = (drawn, *BASE[::2], joint("turn", "ground", "base"), joint("on", "base", "arm"))
    (said,) = errors(mended(tmp_path / "robot.urdf", *parts))
    assert words in said
    assert 'line 3: link "base"' in said


def test_the_pointer_that_git_lfs_leaves_in_a_meshs_place_is_named(tmp_path: Path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "arm.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n")
    (said,) = errors(mended(tmp_path / "robot.urdf", link("arm", "meshes/arm.stl")))
    assert "not the mesh, but a pointer to it of Git LFS -> give `git lfs pull` where it is from" in said


def test_attributes_and_elements_of_other_programs_are_left_out(tmp_path: Path):
    limit = (
        '<limit lower="-1" upper="1" effort="2" velocity="1" drake:acceleration="2.5"/><drake:rotor_inertia value="1"/>'
    )
    parts = (joint("one", "ground", "base", rest=limit), joint("two", "base", "arm", rest=limit))
    found = mended(tmp_path / "robot.urdf", *BASE, *parts)
    names = {name for element in found.xml.root.iter() for name in (element.tag, *element.attrib)}
    assert not any(":" in name for name in names)
    (said,) = (str(each) for each in found.findings() if '"drake:acceleration"' in str(each))
    assert "2 of these" in said


def test_the_harmless_axes_of_many_frames_are_said_once(tmp_path: Path):
    frames = [f'<link name="frame_{number}"/>' for number in range(3)]
    joints = [
        joint(f"to_{number}", "base", f"frame_{number}", axis="0 0 0", kind="fixed", rest="") for number in range(3)
    ]
    found = mended(tmp_path / "robot.urdf", *BASE, *frames, joint("one", "ground", "base"), *joints)
    (said,) = (str(each) for each in found.findings() if "axis is zero" in str(each))
    assert "harmless, and of 2 more" in said


def test_a_mesh_that_is_seen_and_touched_is_missed_once(tmp_path: Path):
    path = write(tmp_path / "robot.urdf", "robot", link("base", "meshes/base.stl"))
    said = [each for each in errors(mend(find_source(path))) if "base.stl" in each]
    assert len(said) == 1


def test_a_link_with_several_collision_shapes_alone_is_said_once(tmp_path: Path):
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    found = mended(tmp_path / "robot.urdf", f'<link name="base">{box * 3}</link>')
    assert len([each for each in found.findings() if "no <visual>" in str(each)]) == 1
    assert len(found.model.links[0].visuals) == 3


@pytest.mark.parametrize("reference", ["arm.STL", "package://arm_description/meshes/arm.STL"])
def test_a_file_in_a_folder_for_urdfs_finds_the_meshes_beside_that_folder(tmp_path: Path, reference: str):
    mesh(tmp_path / "download" / "meshes", "arm.STL")
    found = mended(tmp_path / "download" / "urdf" / "robot.urdf", link("arm", reference))
    assert errors(found) == []


def test_a_file_deep_in_its_package_finds_the_meshes_of_the_package(tmp_path: Path):
    folder = package(tmp_path / "any name", "maker_arm")
    mesh(folder / "data" / "parts", "arm.STL")
    path = folder / "data" / "xacro" / "robots" / "six" / "six.urdf"
    assert errors(mended(path, link("arm", "package://maker_arm/data/parts/arm.STL"))) == []


def test_a_xacro_file_of_macros_alone_says_so(tmp_path: Path):
    path = tmp_path / "arm.xacro"
    path.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="arm" params="prefix">'
        '<link name="${prefix}base"/></xacro:macro></robot>'
    )
    with pytest.raises(DescriptionError, match=r"arm.xacro: it has no <link>: name the file that calls its macros"):
        mend(find_source(path))


def test_lines_of_a_xacro_file_are_those_of_its_expansion(tmp_path: Path):
    path = tmp_path / "arm.xacro"
    path.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="arm" params="prefix">'
        '<link name="${prefix} base"/><link name="${prefix}arm"/></xacro:macro><xacro:arm prefix="a"/></robot>'
    )
    (said,) = (str(each) for each in mend(find_source(path)).findings() if 'link "a base"' in str(each))
    assert re.search(r"arm.xacro, expanded, line [2-9]", said)


def test_several_meshes_of_a_name_that_is_not_where_it_should_be_are_said_with_their_folders(tmp_path: Path):
    for folder in ("left", "right"):
        mesh(tmp_path / "meshes" / folder, "arm.STL")
    said = " ".join(errors(mended(tmp_path / "urdf" / "robot.urdf", link("arm", "arm.STL"))))
    assert "2 have that name: meshes/left/arm.STL, meshes/right/arm.STL" in said


def test_a_robot_without_a_joint_that_moves_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    path = write(tmp_path / "robot.urdf", "robot", f'<link name="base">{box}</link>')
    assert run(["import", str(path), "--yes", "--output", str(tmp_path / "urdf")]) is ExitCode.FAILED
    assert "robot.urdf, line 2: robot: it has no joint that moves" in capsys.readouterr().out


def test_a_robot_without_any_shape_or_length_is_refused_by_import_and_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    parts = ('<link name="base"/>', '<link name="arm"/>', joint("j", "base", "arm", z=0.0))
    path = write(tmp_path / "robot.urdf", "robot", *parts)
    for command in (["import", str(path), "--yes", "--output", str(tmp_path / "urdf")], ["check", str(path)]):
        assert run(command) is not ExitCode.OK
        assert "no link has a <visual> or <collision>" in "".join(capsys.readouterr())


def test_a_file_that_is_no_xml_is_named(tmp_path: Path):
    path = tmp_path / "robot.urdf"
    path.write_text("version https://example.com/spec/v1\n")
    with pytest.raises(DescriptionError, match=r"robot.urdf: not XML"):
        mend(find_source(path))
