"""`check` finds what is wrong with a robot's folder, names it and says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.check import Severity, check
from gemelo.schemas.reasons import Reason, because, remedy, say
from tests.arm.editing import edit


def test_rm1_is_clean(rm1_folder: Path):
    assert check(rm1_folder) == []


FAULTS = [
    (
        "robot.toml",
        "tick_hz = 50_000",
        "tik_hz = 50_000",
        because("file.key.unknown_at", remedy("did_you_mean", name="tick_hz"), key="device.tik_hz"),
    ),
    (
        "robot.toml",
        "max_speed_rpm = 15.0",
        "max_speed_rpm = 60000.0",
        because(
            "robot.motor.pulses",
            remedy("lower_rate"),
            rate=18662400.0,
            rpm=60000.0,
            driver="DM542T",
            high=5e-06,
            low=5e-06,
            fastest=25000.0,
            tick=2e-05,
        ),
    ),
    (
        "robot.toml",
        "step_high_us = 5.0",
        "step_high_us = 500.0",
        because(
            "robot.motor.pulses",
            remedy("lower_rate"),
            rate=4665.6,
            rpm=15.0,
            driver="DM542T",
            high=0.0005,
            low=5e-06,
            fastest=1923.08,
            tick=2e-05,
        ),
    ),
    (
        "robot.toml",
        "ramp_time = 1.0",
        "ramp_time = 0.0",
        because("robot.joint.range", key="ramp_time", value=0.0, least=0.001, most=1000.0),
    ),
    (
        "robot.toml",
        "max_speed_rpm = 15.0",
        "max_speed_rpm = inf",
        because("file.value.not_finite", key="joint[0].max_speed_rpm", value="inf"),
    ),
    (
        "robot.toml",
        "mechanical_upper = 3.1",
        "mechanical_upper = nan",
        because("file.value.not_finite", key="joint[0].mechanical_upper", value="nan"),
    ),
    (
        "robot.toml",
        "pinion_radius = 0.0225",
        "pinion_radius = inf",
        because("file.value.not_finite", key="joint[2].pinion_radius", value="inf"),
    ),
    (
        "robot.toml",
        "step_high_us = 5.0",
        "step_high_us = -5.0",
        because(
            "robot.unreadable",
            because("file.value.bound", key="driver[0].step_high_us", expected="float", bound="> 0.0"),
            remedy("value_of_that_type"),
        ),
    ),
    (
        "robot.toml",
        "tick_hz = 50_000",
        "tick_hz = 0",
        because(
            "robot.unreadable",
            because("file.value.bound", key="device.tick_hz", expected="int", bound=">= 10000"),
            remedy("value_of_that_type"),
        ),
    ),
    (
        "robot.toml",
        "queue_capacity = 128",
        "queue_capacity = 129",
        because(
            "robot.unreadable",
            because("file.value.bound", key="device.queue_capacity", expected="int", bound="<= 128"),
            remedy("value_of_that_type"),
        ),
    ),
    (
        "robot.toml",
        "ramp_time = 1.0",
        "ramp_time = 1.0\ngoal_tolerance_steps = 0.1",
        because(
            "robot.unreadable",
            because("file.value.bound", key="joint[0].goal_tolerance_steps", expected="float", bound=">= 0.5"),
            remedy("value_of_that_type"),
        ),
    ),
    (
        "robot.toml",
        'name = "rm1"',
        'name = "rm/1"',
        because(
            "robot.unreadable",
            because("file.value.bound", key="name", expected="str", bound="matching regex '^[A-Za-z0-9_-]+$'"),
            remedy("value_of_that_type"),
        ),
    ),
    ("robot.toml", "pinion_radius = 0.0225", "pinion_radius = 1e-300", because("robot.motor.pinion", value=1e-300)),
    (
        "robot.srdf",
        'value="2.4"',
        'value="nan"',
        because("file.wrong", because("srdf.state.finite", state="folded", text="nan"), file="FOLDER/robot.srdf"),
    ),
    (
        "robot.toml",
        "step_pin = 18",
        "step_pin = 25",
        because(
            "robot.pin.twice",
            remedy("one_signal_a_pin"),
            count=2,
            users=("brazo_joint step_pin", "antebrazo_joint step_pin"),
        ),
    ),
    (
        "robot.toml",
        "enable_pin = 13",
        "enable_pin = 25",
        because(
            "robot.pin.twice",
            remedy("one_signal_a_pin"),
            count=2,
            users=("[device] enable_pin", "brazo_joint step_pin"),
        ),
    ),
    (
        "robot.toml",
        "trigger_pin = 4",
        "trigger_pin = 2",
        because("robot.pin.twice", remedy("one_signal_a_pin"), count=2, users=('"avanzar"', '"ultra" trigger_pin')),
    ),
    ("robot.toml", "trigger_pin = 4\n", "", because("robot.sensor.no_trigger", remedy("write_key", key="trigger_pin"))),
    (
        "robot.toml",
        'kind = "ultrasonic"',
        'kind = "analog"',
        because("robot.sensor.trigger", remedy("remove_key", key="trigger_pin"), kind="analog"),
    ),
    ("robot.toml", 'name = "ultra"', 'name = "boot_id"', because("robot.sensor.reserved", remedy("another_name"))),
    ("robot.toml", 'name = "ultra"', 'name = "bateria"', because("robot.name.twice", remedy("own_name"), count=2)),
    ("robot.toml", "scale = 0.003", "scale = 0.0", because("robot.sensor.scale", remedy("write_key", key="scale"))),
    (
        "robot.toml",
        "scale = 0.003",
        "scale = 50",
        because(
            "finding.part", because("robot.wire.range", value=3276800000), kind="sensor", name="bateria", part="scale"
        ),
    ),
    ("robot.toml", "sensor_hz = 10", "sensor_hz = 30", because("robot.device.sensor_hz", value=30, nearest=25)),
    (
        "robot.toml",
        'role = "limit_lower"\njoint = "brazo_joint"',
        'role = "estop"',
        because("robot.estop.second", remedy("wire_in_series"), first="estop"),
    ),
    (
        "robot.toml",
        'joint = "brazo_joint"\n',
        "",
        because("robot.switch.no_joint", remedy("write_key", key="joint"), role="limit_lower"),
    ),
    (
        "robot.toml",
        'joint = "brazo_joint"',
        'joint = "braso_joint"',
        because("robot.joint.none", remedy("did_you_mean", name="brazo_joint"), joint="braso_joint"),
    ),
    (
        "robot.toml",
        'role = "estop"',
        'role = "estop"\njoint = "brazo_joint"',
        because("robot.estop.joint", remedy("remove_key", key="joint"), joint="brazo_joint"),
    ),
    (
        "robot.toml",
        'switch = "limit_q1"',
        'switch = "limt_q1"',
        because("robot.homing.no_switch", remedy("did_you_mean", name="limit_q1"), switch="limt_q1"),
    ),
    (
        "robot.toml",
        'switch = "limit_q1"',
        'switch = "limit_q2"',
        because("robot.homing.other_joint", remedy("own_switch"), switch="limit_q2", joint="antebrazo_joint"),
    ),
    (
        "robot.toml",
        'switch = "limit_q1"',
        'switch = "estop"',
        because("robot.homing.other_role", remedy("own_switch"), switch="estop", role="estop"),
    ),
    (
        "robot.toml",
        'direction = "lower"',
        'direction = "upper"',
        because(
            "robot.homing.other_end",
            remedy("write_line", text='direction = "lower"'),
            direction="upper",
            switch="limit_q1",
            role="limit_lower",
        ),
    ),
    (
        "robot.toml",
        "position = -3.02",
        "position = 3.02",
        because("robot.homing.nearer_other", remedy("correct_direction"), direction="lower", position=3.02, unit="rad"),
    ),
    (
        "robot.toml",
        "position = -3.02",
        "position = -3.2",
        because(
            "robot.homing.unreachable", remedy("correct_mechanics"), position=-3.2, lower=-3.1, upper=3.1, unit="rad"
        ),
    ),
    (
        "robot.toml",
        "position = -3.02",
        "position = -2.9",
        because("robot.homing.within_travel", remedy("make_it_home"), switch="limit_q1", position=-2.9, unit="rad"),
    ),
    (
        "robot.toml",
        "fast = 0.3",
        "fast = 1.6",
        because("robot.homing.too_fast", remedy("home_slower"), key="fast", value=1.6, limit=1.5708, unit="rad"),
    ),
    (
        "robot.toml",
        "fast = 0.3",
        "fast = 0.6",
        because("robot.homing.runs_on", remedy("brake_earlier"), position=-3.13459, unit="rad"),
    ),
    (
        "robot.toml",
        "slow = 0.03",
        "slow = 0.31",
        because("robot.homing.slow_faster", remedy("slower_second"), slow=0.31, fast=0.3, unit="rad"),
    ),
    (
        "robot.toml",
        "back_off = 0.12",
        "back_off = 0.05",
        because(
            "robot.homing.rests_outside", remedy("longer_back_off"), position=-2.97, lower=-2.95, upper=2.95, unit="rad"
        ),
    ),
    (
        "robot.toml",
        "speed = [0, 1000,",
        "speed = [1000,",
        because("robot.pull_out.lengths", remedy("torque_for_speed"), speeds=6, torques=7),
    ),
    (
        "robot.toml",
        "speed = [0, 1000, 2000",
        "speed = [0, 2000, 1000",
        because("robot.pull_out.falls", remedy("rising_order"), first=2000.0, second=1000.0),
    ),
    (
        "robot.toml",
        'wire_name = "q1"',
        'wire_name = "q1"\nreference_position = 9.0',
        because(
            "robot.reference.outside", remedy("reference_within"), position=9.0, lower=-2.95, upper=2.95, unit="rad"
        ),
    ),
    (
        "robot.toml",
        "mechanical_upper = 3.1",
        "mechanical_upper = 2.0",
        because(
            "robot.joint.mechanics",
            remedy("write_in_urdf", text='upper="2"'),
            side="upper",
            limit=2.95,
            mechanics=2.0,
            unit="rad",
        ),
    ),
    (
        "robot.toml",
        'gear_ratio = "46.656"',
        'gear_ratio = "4665600"',
        because("robot.motor.steps", remedy("fewer_microsteps"), steps=876213000.0, limit=8388610.0),
    ),
    (
        "robot.toml",
        'transmission = "rack_and_pinion"\n',
        "",
        because(
            "robot.transmission",
            remedy("write_transmission", transmission="rack_and_pinion"),
            kind="prismatic",
            transmission="rotary",
        ),
    ),
    (
        "robot.urdf",
        "meshes/brazo_link.glb",
        "meshes/braso_link.glb",
        because(
            "mesh.none",
            remedy("did_you_mean", name="meshes/brazo_link.glb"),
            remedy("put_file_there"),
            mesh="meshes/braso_link.glb",
        ),
    ),
    (
        "robot.urdf",
        "meshes/base_link.glb",
        "package://rm1/meshes/base_link.glb",
        because(
            "mesh.package",
            remedy("write_line", text='filename="meshes/base_link.glb"'),
            mesh="package://rm1/meshes/base_link.glb",
        ),
    ),
    (
        "robot.urdf",
        'upper="0.2" effort="17"',
        'upper="0" effort="17"',
        because("urdf.limit.no_travel", remedy("lower_below_upper"), lower=0.0, upper=0.0),
    ),
    (
        "robot.urdf",
        'effort="25"',
        'effort="0"',
        because("urdf.limit.zero", remedy("above_zero"), quantity="effort", value=0.0),
    ),
    (
        "robot.urdf",
        'velocity="0.05"',
        'velocity="0"',
        because("urdf.limit.zero", remedy("above_zero"), quantity="velocity", value=0.0),
    ),
    (
        "robot.urdf",
        '<mass value="0.338"/>',
        '<mass value="0"/>',
        because("urdf.mass", remedy("leave_inertial_out"), mass=0.0),
    ),
    (
        "robot.urdf",
        'ixx="0.000282"',
        'ixx="-0.000282"',
        because("urdf.inertia.negative", remedy("all_above_zero"), value=-0.000282),
    ),
    (
        "robot.urdf",
        'izz="0.001956"',
        'izz="0.1"',
        because("urdf.inertia.no_body", remedy("compute_inertia"), low=0.000282, middle=0.001904, high=0.1),
    ),
    (
        "robot.urdf",
        '<child link="efector_link"/>',
        '<child link="effector_link"/>',
        because(
            "urdf.joint.no_link",
            remedy("did_you_mean", name="efector_link"),
            remedy("name_a_link", role="child"),
            role="child",
            link="effector_link",
        ),
    ),
    (
        "robot.urdf",
        '<cylinder radius="0.062"',
        '<capsule radius="0.062"',
        because("urdf.shape.unknown", remedy("write_line", text="<cylinder>"), shape="capsule", role="collision"),
    ),
    (
        "robot.urdf",
        '<parent link="brazo_link"/>',
        '<parent link="antebrazo_link"/>',
        because("urdf.ring", remedy("open_the_ring"), joints=("antebrazo_joint",)),
    ),
    (
        "robot.srdf",
        'value="2.4"',
        'value="3.4"',
        because(
            "srdf.state.limits",
            remedy("nearest_in_limits", value=2.95, unit="rad"),
            joint="antebrazo_joint",
            value=3.4,
            unit="rad",
            lower=-2.95,
            upper=2.95,
        ),
    ),
    (
        "robot.srdf",
        'link1="base_link" link2="brazo_link"',
        'link1="base_lnk" link2="brazo_link"',
        because("srdf.missing", remedy("did_you_mean", name="base_link"), kind="link", name="base_lnk"),
    ),
    (
        "robot.srdf",
        'tip_link="efector_link"',
        'tip_link="tool"',
        because(
            "srdf.missing",
            remedy("known_are", names=("antebrazo_link", "base_link", "brazo_link", "efector_link")),
            kind="link",
            name="tool",
        ),
    ),
    (
        "robot.srdf",
        '<group name="arm">',
        '<group name="hand">',
        because("srdf.missing", remedy("known_are", names=("hand",)), kind="group", name="arm"),
    ),
]


def alike(found: Reason, expected: Reason, folder: Path) -> bool:
    """The same codes and values, numbers to five digits."""
    values = {
        name: value.replace("FOLDER", str(folder)) if isinstance(value, str) else pytest.approx(value, rel=1e-5)
        for name, value in expected.values.items()
        if not isinstance(value, tuple)
    }
    lists = {name: value for name, value in expected.values.items() if isinstance(value, tuple)}
    return (
        (found.code, found.values, found.remedies) == (expected.code, values | lists, expected.remedies)
        and len(found.causes) == len(expected.causes)
        and all(alike(*pair, folder) for pair in zip(found.causes, expected.causes, strict=True))
    )


@pytest.mark.parametrize(("file", "old", "new", "reason"), FAULTS)
def test_a_fault_is_found_with_its_reason(copy: Path, file: str, old: str, new: str, reason: Reason):
    edit(copy / file, old, new)
    findings = check(copy)
    assert any(alike(f.what, reason, copy) and f.severity is Severity.ERROR for f in findings), findings
    assert all(str(f).count(f.subject) == 1 or not f.subject.startswith("joint ") for f in findings), "named twice"


def test_a_finding_is_a_sentence_in_each_language(copy: Path):
    edit(copy / "robot.urdf", 'upper="0.2" effort="17"', 'upper="0" effort="17"')
    (finding,) = (each for each in check(copy) if each.what.code == "urdf.limit.no_travel")
    assert str(finding) == (
        f'error: robot.urdf, line {finding.line}: joint "efector_joint": limits 0 to 0 leave no travel -> give lower < '
        "upper"
    )
    said = say(finding.reason, "es")
    assert said.startswith(f"error: robot.urdf, línea {finding.line}: articulación «efector_joint»: ")
    assert said.endswith("os límites 0 a 0 no dejan recorrido -> dé lower < upper")


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
