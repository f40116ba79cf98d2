"""A URDF's faults: all of them at once, each with its line, its name and what would do."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.check import Severity, check
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.urdf import read_urdf, survey_urdf
from tests.arm.bare_arm import URDF, write_bare_arm
from tests.arm.editing import edit


def wrong(folder: Path) -> Path:
    """A robot's folder with five faults in its URDF."""
    urdf = write_bare_arm(folder) / "robot.urdf"
    edit(urdf, '<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>')
    edit(urdf, 'upper="0.4"', 'upper="0,4"')
    edit(urdf, 'name="flange" type="fixed"', 'name="flange" type="floating"')
    edit(urdf, '<child link="upper"/>', "")
    edit(urdf, '<link name="hand"/>', '<link name="hand"><inertial><mass value="1"/></inertial></link>')
    return urdf


def test_every_fault_is_said_at_once_with_line_name_and_remedy(tmp_path: Path):
    urdf = wrong(tmp_path)
    with pytest.raises(DescriptionError) as caught:
        read_urdf(urdf)
    for words in (
        ("line 2", 'link "hand"', "<inertia> is missing"),
        ("line 8", 'joint "reach"', '"0,4" is not a number', 'write "0.4"'),
        ("line 10", 'joint "turn"', "<child> is missing"),
        ("line 11", 'joint "turn"', "the axis is zero", 'xyz="0 0 1"'),
        ("line 14", 'joint "flange"', 'type "floating" is not one of', "make it fixed"),
    ):
        assert any(all(word in line for word in words) for line in str(caught.value).splitlines()), words
    assert len(str(caught.value).splitlines()) == 5


def test_check_says_them_all_and_what_else_is_wrong(tmp_path: Path):
    wrong(tmp_path)
    edit(tmp_path / "robot.urdf", 'effort="9" velocity="0.5"', 'effort="0" velocity="0.5"')
    found = [finding for finding in check(tmp_path) if finding.severity is Severity.ERROR]
    assert len([finding for finding in found if finding.line]) >= 6
    assert any("its effort limit is 0" in finding.message and finding.line == 7 for finding in found)


def test_a_zero_axis_on_a_fixed_joint_is_harmless(tmp_path: Path):
    model, faults = survey_urdf(write_bare_arm(tmp_path) / "robot.urdf")
    assert faults == []
    assert model.joint("flange").axis == (1.0, 0.0, 0.0)
    assert load_arm(tmp_path).joint_names == ("turn", "reach")


@pytest.mark.parametrize(
    ("old", "new", "message", "remedy", "severity"),
    [
        ('lower="-2" upper="2"', 'lower="-180" upper="180"', "beyond four turns", "degrees", Severity.WARNING),
        ('upper="0.4"', 'upper="400"', "is beyond 5 m", "mm", Severity.WARNING),
        ('velocity="3.0"', 'velocity="180"', "180 rad/s is implausible", "degrees per second", Severity.WARNING),
        ('<mimic joint="reach"', '<mimic joint="flange"', 'mimics "flange", which is fixed', "motor", Severity.ERROR),
        (
            '<link name="hand"/>',
            '<link name="hand"><inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
            "</inertial></link>",
            "its mass is 0 kg",
            "leave <inertial> out",
            Severity.ERROR,
        ),
        (
            '<link name="hand"/>',
            '<link name="hand"/><link name="loose"/>',
            "has 2 roots",
            "fixed joint",
            Severity.ERROR,
        ),
    ],
)
def test_what_is_implausible_is_named(
    tmp_path: Path, old: str, new: str, message: str, remedy: str, severity: Severity
):
    edit(write_bare_arm(tmp_path) / "robot.urdf", old, new)
    found = check(tmp_path)
    assert any(
        message in each.message and remedy in each.remedy and each.severity is severity and each.line for each in found
    ), found


def test_the_lines_are_those_of_the_file(tmp_path: Path):
    model, _ = survey_urdf(write_bare_arm(tmp_path) / "robot.urdf")
    lines = URDF.splitlines()
    for joint in model.joints:
        assert f'<joint name="{joint.name}"' in lines[joint.line - 1]
