"""The device's configuration of robot.toml, to the last 1/256 step, and the refusals of what it cannot hold."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace as with_
from fractions import Fraction
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.libraries.arm.device.device_config import HEADROOM, device_config, reference_steps, sensor_config
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.device_config import UNUSED, DeviceConfig, InputRole, Pull, SensorKind, config_crc, config_text
from gemelo.schemas.robot import Sensor

TABLES = """
[[input]]
name = "home_q1"
pin = 32
role = "home"
joint = "brazo_joint"
active = "low"
pull = "up"

[[input]]
name = "seta"
pin = 21
role = "estop"

[[output]]
name = "avanzar"
pin = 2
off_at_estop = true

[[sensor]]
name = "ultra"
kind = "ultrasonic"
pin = 35
trigger_pin = 4
unit = "cm"
scale = 0.01715
offset = -0.5
"""
HOMING = """
[joint.homing]
switch = "home_q1"
direction = "lower"
position = -3.0
fast = 0.5
slow = 0.05
back_off = 0.1
group = 2
"""


@pytest.fixture
def folder(rm1_folder: Path, tmp_path: Path) -> Path:
    """rm1 with nothing but its motors, and then one of everything."""
    folder = Path(shutil.copytree(rm1_folder, tmp_path / "rm1"))
    text = (folder / "robot.toml").read_text()
    plain = "\n\n".join(
        block
        for block in text.split("\n\n")
        if not any(f"[{table}" in block for table in ("[input", "[output", "[sensor", "gripper]", "joint.homing"))
    )
    head, _, tail = plain.partition('wire_name = "q2"')
    start = head.rindex("[[joint]]")
    (folder / "robot.toml").write_text(head[:start] + HOMING + "\n" + head[start:] + 'wire_name = "q2"' + tail + TABLES)
    return folder


def edited(folder: Path, old: str, new: str) -> ArmDescription:
    file = folder / "robot.toml"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new, 1))
    return load_arm(folder)


def test_everything_of_robot_toml_reaches_the_device(folder: Path) -> None:
    arm = load_arm(folder)
    config = device_config(arm)
    joint = arm.joints[0]
    first = config.joints[0]
    assert (config.name, first.name, first.step_pin, first.dir_pin) == ("rm1", "q1", 25, 27)
    assert [one.inverted for one in config.joints] == [False, True, False]
    assert config.enable_lead_ms == 200
    homing = first.homing
    assert homing is not None
    assert (homing.input, homing.group, homing.direction, homing.timeout_ms) == (0, 2, -1, 60_000)
    assert homing.position_q8 == joint.steps.to_q8(-3.0)
    assert homing.max_travel_q8 == joint.steps.to_q8(1.1 * (joint.upper - joint.lower))
    assert (homing.fast_q8, homing.slow_q8) == (joint.steps.to_q8(0.5), joint.steps.to_q8(0.05))
    switch, stop = config.inputs
    assert (switch.joint, switch.role, switch.inverted, switch.pull) == (0, InputRole.HOME, True, Pull.UP)
    assert (stop.joint, stop.role, stop.inverted) == (UNUSED, InputRole.ESTOP, False)
    assert config.outputs[0].off_at_estop
    sensor = config.sensors[0]
    assert (sensor.kind, sensor.pin, sensor.trigger_pin) == (SensorKind.ULTRASONIC, 35, 4)
    assert (sensor.scale_q16, sensor.offset_milli) == (1_123_942, -500)


def test_a_limit_of_the_device_holds_every_knot_that_the_gateway_may_send(rm1: ArmDescription) -> None:
    for joint, told in zip(rm1.joints, device_config(rm1).joints, strict=True):
        assert (told.lower_q8, told.upper_q8) == (joint.steps.to_q8(joint.lower), joint.steps.to_q8(joint.upper))
        for limit, value in ((joint.velocity, told.max_velocity_q8), (joint.acceleration, told.max_acceleration_q8)):
            wanted = limit * joint.steps.per_unit * 256 * HEADROOM
            assert -1e-6 <= value - wanted < 1.0


def test_text_mode_counts_as_exactly_as_knots_do(rm1: ArmDescription) -> None:
    for joint, told in zip(rm1.joints, device_config(rm1).joints, strict=True):
        for position in (joint.lower, joint.upper, 0.1234567):
            units = round(position * 10**7)
            assert abs(units * told.text_scale_q32 / 2**32 - joint.steps.to_q8(units / 10**7)) <= 0.51


def test_the_same_arm_has_the_same_text_and_crc(rm1_folder: Path) -> None:
    texts = {config_text(device_config(load_arm(rm1_folder))) for _ in range(2)}
    assert len(texts) == 1
    (text,) = texts
    assert msgspec.json.decode(text, type=DeviceConfig) == device_config(load_arm(rm1_folder))
    assert config_crc(text) != config_crc(text.replace(b"q1", b"q9"))


@given(st.floats(-32.0, 32.0), st.floats(-2e6, 2e6))
def test_a_sensor_is_scaled_to_half_a_unit_of_the_wire(scale: float, offset: float) -> None:
    told = sensor_config(Sensor(name="s", kind=SensorKind.ANALOG, pin=1, scale=scale, offset=offset))
    assert abs(Fraction(told.scale_q16, 65_536_000) - Fraction(scale)) <= Fraction(1, 2 * 65_536_000)
    assert abs(Fraction(told.offset_milli, 1000) - Fraction(offset)) <= Fraction(1, 2000)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('switch = "home_q1"', 'switch = "hom_q1"', ('joint "brazo_joint"', '"hom_q1"', 'did you mean "home_q1"')),
        ('joint = "brazo_joint"', 'joint = "braso_joint"', ('input "home_q1"', "braso_joint", "brazo_joint")),
        ('joint = "brazo_joint"\n', "", ('input "home_q1"', "`joint`")),
        ('role = "estop"', 'role = "estop"\njoint = "brazo_joint"', ('input "seta"', "remove `joint`")),
        ("slow = 0.05", "slow = 1e-9", ('joint "brazo_joint"', "homing.slow: it is 1e-09", "at least one step")),
        ("back_off = 0.1", "back_off = 1e9", ("homing.back_off", "32 bits")),
        ("scale = 0.01715", "scale = 40.0", ('sensor "ultra"', "scale", "32 bits")),
        ('wire_name = "q1"', 'wire_name = "q 1"', ('joint "brazo_joint"', '"q 1"', "letters")),
        ("step_high_us = 5.0", "step_high_us = 25.0", ('joint "brazo_joint"', "20 us", "DM542T", "tick_hz")),
        ("sensor_hz = 10", "sensor_hz = 30", ("sensor_hz is 30", "write 25")),
    ],
)  # fmt: skip
def test_what_a_device_cannot_be_told_is_said_with_its_remedy(
    folder: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    arm = edited(folder, old, new)
    with pytest.raises(DescriptionError) as refused:
        device_config(arm)
    for word in words:
        assert word in str(refused.value)


def test_a_joint_without_limits_is_as_free_as_the_wire_and_must_say_how_far_it_looks_for_its_switch(
    folder: Path,
) -> None:
    urdf = folder / "robot.urdf"
    urdf.write_text(
        urdf.read_text().replace('name="brazo_joint" type="revolute"', 'name="brazo_joint" type="continuous"')
    )
    with pytest.raises(DescriptionError, match=r"max_travel"):
        device_config(load_arm(folder))
    arm = edited(folder, "back_off = 0.1", "back_off = 0.1\nmax_travel = 7.0")
    first = device_config(arm).joints[0]
    assert math.isinf(arm.joints[0].upper)
    assert (first.lower_q8, first.upper_q8) == (-(2**30), 2**30)


def test_more_of_a_kind_than_the_device_has_is_refused(rm1: ArmDescription) -> None:
    sensors = tuple(Sensor(name=f"s{i}", kind=SensorKind.ANALOG, pin=i) for i in range(9))
    with pytest.raises(DescriptionError, match=r"9 \[\[sensor\]\].*8"):
        device_config(with_(rm1, sensors=sensors))


def test_the_reference_pose_is_whole_steps(rm1: ArmDescription) -> None:
    moved = replace(rm1.joints[0].drive, reference_position=0.5)
    arm = with_(rm1, joints=(with_(rm1.joints[0], drive=moved), *rm1.joints[1:]))
    assert reference_steps(arm) == (1485, 0, 0)
