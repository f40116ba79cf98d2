"""`check` finds what is wrong with a robot's folder, names it and says what to do."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from services.arm.check import Severity, check


@pytest.fixture
def copy(rm1_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(rm1_folder, tmp_path / "rm1"))


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


def test_rm1_is_clean(rm1_folder: Path):
    assert check(rm1_folder) == []


FAULTS = [
    ("robot.toml", "tick_hz = 50_000", "tik_hz = 50_000", "unknown key `device.tik_hz`", "tick_hz"),
    ("robot.toml", "max_speed_rpm = 15.0", "max_speed_rpm = 60000.0", "steps/s at 60000 RPM", "lower max_speed_rpm"),
    ("robot.toml", "step_high_us = 5.0", "step_high_us = 500.0", "needs 500 us high", "tick_hz"),
    ("robot.toml", "ramp_time = 1.0", "ramp_time = 0.0", "ramp_time is 0", ""),
    ("robot.toml", "max_speed_rpm = 15.0", "max_speed_rpm = inf", "line 36: `joint[0].max_speed_rpm` is inf", "finite"),
    (
        "robot.toml",
        "ramp_time = 1.0",
        "ramp_time = 1.0\nmechanical_upper = nan",
        "`joint[0].mechanical_upper` is nan",
        "",
    ),
    ("robot.toml", "pinion_radius = 0.0225", "pinion_radius = inf", "`joint[2].pinion_radius` is inf", "finite"),
    (
        "robot.toml",
        "step_high_us = 5.0",
        "step_high_us = -5.0",
        "> 0.0 - at `$.driver[0].step_high_us`",
        "schemas/robot",
    ),
    ("robot.toml", "tick_hz = 50_000", "tick_hz = 0", "line 13: Expected `int` >= 10000", "schemas/robot.py"),
    ("robot.toml", "queue_capacity = 128", "queue_capacity = 129", "<= 128 - at `$.device.queue_capacity`", ""),
    ("robot.toml", "ramp_time = 1.0", "ramp_time = 1.0\ngoal_tolerance_steps = 0.1", ">= 0.5", "schemas/robot.py"),
    ("robot.toml", 'name = "rm1"', 'name = "rm/1"', "line 4: Expected `str` matching regex", "schemas/robot.py"),
    ("robot.toml", "pinion_radius = 0.0225", "pinion_radius = 1e-300", "0.0001 to 10 m", ""),
    ("robot.srdf", 'value="2.4"', 'value="nan"', 'state "folded": nan is not finite', ""),
    ("robot.toml", "step_pin = 18", "step_pin = 25", "is used 2 times", "one signal a pin"),
    ("robot.toml", 'wire_name = "q1"', 'wire_name = "q1"\nreference_position = 9.0', "outside -2.95 to 2.95", ""),
    (
        "robot.toml",
        'wire_name = "q1"',
        'wire_name = "q1"\nmechanical_upper = 2.0',
        "beyond the mechanics' 2 rad",
        "upper=2",
    ),
    ("robot.toml", 'gear_ratio = "46.656"', 'gear_ratio = "4665600"', "does not fit the wire", "microsteps"),
    ("robot.toml", 'transmission = "rack_and_pinion"\n', "", "transmission is rotary", "metres are not radians"),
    ("robot.urdf", "meshes/brazo_link.glb", "meshes/braso_link.glb", 'mesh "meshes/braso_link.glb" is not there', ""),
    (
        "robot.urdf",
        "meshes/base_link.glb",
        "package://rm1/meshes/base_link.glb",
        "ROS package path",
        "meshes/base_link.glb",
    ),
    ("robot.urdf", 'upper="0.2" effort="17"', 'upper="0" effort="17"', "leave no travel", "lower < upper"),
    ("robot.urdf", 'effort="25"', 'effort="0"', "its effort limit is 0", "above 0"),
    ("robot.urdf", 'velocity="0.05"', 'velocity="0"', "its velocity limit is 0", "above 0"),
    ("robot.urdf", '<mass value="0.338"/>', '<mass value="0"/>', "its mass is 0", "above 0"),
    ("robot.urdf", 'ixx="0.000282"', 'ixx="-0.000282"', "principal moment", "above 0"),
    ("robot.urdf", 'izz="0.001956"', 'izz="0.1"', "no body has such inertia", "b^2"),
    (
        "robot.urdf",
        '<child link="efector_link"/>',
        '<child link="effector_link"/>',
        'its child "effector_link" is no link',
        "",
    ),
    ("robot.urdf", '<cylinder radius="0.062"', '<capsule radius="0.062"', "would be ignored", "<cylinder>"),
    ("robot.urdf", '<parent link="brazo_link"/>', '<parent link="antebrazo_link"/>', "is not connected to", ""),
    ("robot.srdf", 'value="2.4"', 'value="3.4"', "antebrazo_joint = 3.4 is outside", "2.95"),
    (
        "robot.srdf",
        'link1="base_link" link2="brazo_link"',
        'link1="base_lnk" link2="brazo_link"',
        '"base_lnk" does not',
        "",
    ),
    ("robot.srdf", 'tip_link="efector_link"', 'tip_link="tool"', 'link "tool" does not exist', ""),
    ("robot.srdf", '<group name="arm">', '<group name="hand">', 'group "arm" does not exist', ""),
]


@pytest.mark.parametrize(("file", "old", "new", "message", "remedy"), FAULTS)
def test_a_fault_is_found_and_named(copy: Path, file: str, old: str, new: str, message: str, remedy: str):
    edit(copy / file, old, new)
    findings = check(copy)
    assert any(message in str(f) and remedy in str(f) and f.severity is Severity.ERROR for f in findings), findings
    assert all(str(f).count(f.thing) == 1 or not f.thing.startswith("joint ") for f in findings), "named twice"


def test_one_fault_does_not_hide_another(copy: Path):
    edit(copy / "robot.toml", "tick_hz = 50_000", "tik_hz = 50_000")
    edit(copy / "robot.urdf", 'effort="25"', 'effort="0"')
    assert {f.file for f in check(copy)} == {"robot.toml", "robot.urdf"}


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("robot.urdf", 'effort="25"', 'effort="300"', "placeholder"),
        ("robot.urdf", 'velocity="1.57"', 'velocity="30"', "its motor does 1.571 rad/s"),
        (
            "robot.toml",
            "pulses_per_turn = 400\nstep_pin = 18",
            "pulses_per_turn = 200\nstep_pin = 18",
            "one step is 31.4 mrad",
        ),
        ("robot.srdf", '<robot name="rm1">', '<robot name="rm2">', 'is named "rm2"'),
    ],
)
def test_what_is_only_odd_is_a_warning(copy: Path, file: str, old: str, new: str, message: str):
    edit(copy / file, old, new)
    (finding,) = check(copy)
    assert finding.severity is Severity.WARNING
    assert message in finding.message


@pytest.mark.parametrize("name", ["robot.toml", "robot.urdf", "robot.srdf"])
def test_a_missing_or_broken_file_is_one_finding(copy: Path, name: str):
    (copy / name).write_bytes(b"\xff\xfe<<<")
    assert any(finding.severity is Severity.ERROR for finding in check(copy))
    (copy / name).unlink()
    assert any("no such file" in finding.message for finding in check(copy))


def test_a_mesh_that_cannot_be_opened_is_an_error(copy: Path):
    (copy / "meshes" / "brazo_link.glb").write_bytes(b"no mesh")
    (finding,) = check(copy)
    assert finding.severity is Severity.ERROR
    assert "yourdfpy cannot load it" in finding.message
    assert "brazo_link.glb" in finding.remedy
