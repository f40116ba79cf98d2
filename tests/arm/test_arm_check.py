"""`check` finds what is wrong with a robot's folder, names it and says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.check import Severity, check
from tests.arm.editing import edit


def test_rm1_is_clean(rm1_folder: Path):
    assert check(rm1_folder) == []


FAULTS = [
    ("robot.toml", "tick_hz = 50_000", "tik_hz = 50_000", "unknown key `device.tik_hz`", "tick_hz"),
    ("robot.toml", "max_speed_rpm = 15.0", "max_speed_rpm = 60000.0", "steps/s at 60000 RPM", "lower max_speed_rpm"),
    ("robot.toml", "step_high_us = 5.0", "step_high_us = 500.0", "needs 500 us high", "tick_hz"),
    ("robot.toml", "ramp_time = 1.0", "ramp_time = 0.0", "ramp_time is 0", ""),
    (
        "robot.toml",
        "max_speed_rpm = 15.0",
        "max_speed_rpm = inf",
        "line 103: `joint[0].max_speed_rpm` is inf",
        "finite",
    ),
    (
        "robot.toml",
        "mechanical_upper = 3.1",
        "mechanical_upper = nan",
        "`joint[0].mechanical_upper` is nan",
        "",
    ),
    ("robot.toml", "pinion_radius = 0.0225", "pinion_radius = inf", "`joint[2].pinion_radius` is inf", "finite"),
    (
        "robot.toml",
        "step_high_us = 5.0",
        "step_high_us = -5.0",
        "> 0.0 - at `$.driver[0].step_high_us`",
        "of that type and range",
    ),
    ("robot.toml", "tick_hz = 50_000", "tick_hz = 0", "line 14: Expected `int` >= 10000", "of that type and range"),
    ("robot.toml", "queue_capacity = 128", "queue_capacity = 129", "<= 128 - at `$.device.queue_capacity`", ""),
    (
        "robot.toml",
        "ramp_time = 1.0",
        "ramp_time = 1.0\ngoal_tolerance_steps = 0.1",
        ">= 0.5",
        "of that type and range",
    ),
    ("robot.toml", 'name = "rm1"', 'name = "rm/1"', "line 4: Expected `str` matching regex", "of that type and range"),
    ("robot.toml", "pinion_radius = 0.0225", "pinion_radius = 1e-300", "0.0001 to 10 m", ""),
    ("robot.srdf", 'value="2.4"', 'value="nan"', 'state "folded": nan is not finite', ""),
    (
        "robot.toml",
        "step_pin = 18",
        "step_pin = 25",
        "is used 2 times: brazo_joint's step_pin, ant",
        "one signal a pin",
    ),
    ("robot.toml", "enable_pin = 13", "enable_pin = 25", "pin 25: is used 2 times: [device] enable_pin", ""),
    ("robot.toml", "trigger_pin = 4", "trigger_pin = 2", 'pin 2: is used 2 times: "avanzar", "ultra"\'s trig', ""),
    ("robot.toml", "trigger_pin = 4\n", "", 'sensor "ultra": an ultrasonic', "trigger_pin"),
    ("robot.toml", 'kind = "ultrasonic"', 'kind = "analog"', "kind analog has no trigger_pin", "remove"),
    ("robot.toml", 'name = "ultra"', 'name = "boot_id"', "name is taken", "another"),
    ("robot.toml", 'name = "ultra"', 'name = "bateria"', 'sensor "bateria": is there 2 times', "of its own"),
    ("robot.toml", "scale = 0.003", "scale = 0.0", 'sensor "bateria": its scale is 0', "scale"),
    ("robot.toml", "scale = 0.003", "scale = 50", 'sensor "bateria": scale', "smaller"),
    ("robot.toml", "sensor_hz = 10", "sensor_hz = 30", "sensor_hz is 30", "write 25"),
    (
        "robot.toml",
        'role = "limit_lower"\njoint = "brazo_joint"',
        'role = "estop"',
        'input "limit_q1": is a second e-stop besides "estop"',
        "in series",
    ),
    ("robot.toml", 'joint = "brazo_joint"\n', "", 'input "limit_q1": a limit_lower switch belongs', "write `joint`"),
    ("robot.toml", 'joint = "brazo_joint"', 'joint = "braso_joint"', 'no joint "braso_joint"', "brazo_joint"),
    ("robot.toml", 'role = "estop"', 'role = "estop"\njoint = "brazo_joint"', "belongs to all joints", "remove"),
    ("robot.toml", 'switch = "limit_q1"', 'switch = "limt_q1"', '"limt_q1" is no [[input]]', "limit_q1"),
    ("robot.toml", 'switch = "limit_q1"', 'switch = "limit_q2"', 'is of joint "antebrazo_joint"', "of this joint"),
    ("robot.toml", 'switch = "limit_q1"', 'switch = "estop"', "is an estop", "of this joint"),
    ("robot.toml", 'direction = "lower"', 'direction = "upper"', "is its limit_lower switch", 'direction = "lower"'),
    ("robot.toml", "position = -3.02", "position = 3.02", "is nearer the other", "direction or position"),
    ("robot.toml", "position = -3.02", "position = -3.2", "outside the mechanics' -3.1 to 3.1", "mechanical_lower"),
    ("robot.toml", "position = -3.02", "position = -2.9", "within its travel", 'role "home"'),
    ("robot.toml", "fast = 0.3", "fast = 1.6", "homing.fast 1.6 is beyond the 1.571", "slower"),
    ("robot.toml", "fast = 0.3", "fast = 0.6", "it runs on to -3.135 rad", "lower homing.fast"),
    ("robot.toml", "slow = 0.03", "slow = 0.31", "homing.slow 0.31 is faster", "slower"),
    ("robot.toml", "back_off = 0.12", "back_off = 0.05", "it stands at -2.97 rad, outside", "longer back_off"),
    ("robot.toml", "speed = [0, 1000,", "speed = [1000,", "has 6 speeds and 7 torques", "one torque"),
    ("robot.toml", "speed = [0, 1000, 2000", "speed = [0, 2000, 1000", "falls from 2000 to 1000", "rising order"),
    ("robot.toml", 'wire_name = "q1"', 'wire_name = "q1"\nreference_position = 9.0', "outside -2.95 to 2.95", ""),
    (
        "robot.toml",
        "mechanical_upper = 3.1",
        "mechanical_upper = 2.0",
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
    assert all(str(f).count(f.subject) == 1 or not f.subject.startswith("joint ") for f in findings), "named twice"


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
        ("robot.toml", "back_off = 0.12", "back_off = 0.12\nmax_travel = 5.0", "shorter than the 5.97 rad"),
        (
            "robot.toml",
            "back_off = 0.12",
            "back_off = 0.12\ntimeout = 20",
            "takes 25 s, longer than its timeout of 20 s",
        ),
        ("robot.toml", "0.7, 0.45, 0.28", "0.05, 0.03, 0.02", "it will lose steps"),
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


@pytest.mark.parametrize(
    ("scale", "mass", "severity", "message"),
    [
        ("1000", "0.465", Severity.ERROR, "m long: it is in millimetres"),
        ("1", "46.5", Severity.WARNING, "no material has that density"),
    ],
)
def test_a_mesh_in_another_unit_and_a_link_of_no_density_are_named(
    copy: Path, scale: str, mass: str, severity: Severity, message: str
):
    scaled = f'meshes/brazo_link.glb" scale="{scale} {scale} {scale}"'
    edit(copy / "robot.urdf", 'meshes/brazo_link.glb"', scaled)
    edit(copy / "robot.urdf", '<mass value="0.465"/>', f'<mass value="{mass}"/>')
    (finding,) = check(copy)
    assert finding.severity is severity
    assert message in finding.message
    assert finding.line
