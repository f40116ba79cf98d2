"""[gripper] of robot.toml: read as types, and refused with the line, the value and the remedy."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from msgspec import UNSET

from gemelo.libraries.arm.checks.check import check
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.device_config import ServoConfig
from gemelo.schemas.grippers.output import OutputGripper
from gemelo.schemas.grippers.servo import ServoGripper
from tests.arm.editing import edit

URDF = Path(__file__).resolve().parents[2] / "urdf"


@pytest.fixture
def copy(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    return Path(shutil.copytree(URDF / getattr(request, "param", "rm1"), tmp_path / "robot"))


def line_of(folder: Path, text: str) -> int:
    return (folder / "robot.toml").read_text().split(text)[0].count("\n") + 1


def test_rm1_has_a_servo_and_parol6_a_valve():
    rm1, parol6 = load_arm(URDF / "rm1"), load_arm(URDF / "parol6")
    assert isinstance(rm1.gripper, ServoGripper)
    assert device_config(rm1).servo == ServoConfig(
        name="gripper", pin=14, lower_us=1000, upper_us=2000, speed_us_s=2000, off_at_estop=False
    )
    assert isinstance(parol6.gripper, OutputGripper)
    assert device_config(parol6).servo is UNSET


@pytest.mark.parametrize(
    ("old", "new", "key", "sentence"),
    [
        ("open = 0.05", "open = 0.0001\nclosed_too = 1", "closed_too", "unknown key `gripper.closed_too`"),
        ("closed = 0.0", "closed = 0.05", "open = ", "[gripper] open 0.05 m is not wider than closed, 0.05 m"),
        ("open_us = 2000", "open_us = 1050", "open_us", "[gripper] open_us 1050 us and closed_us 1000 us are nearer"),
        ("open_us = 2000", "open_us = 2600", "open_us", "expected `int` <= 2500"),
        (
            "speed = 0.1\n",
            "speed = 900.0\n",
            "speed = 900",
            "900 m/s is 18000000 us/s of pulse: write 0.0005 to 50 m/s",
        ),
        ("speed = 0.1\n", "speed = nan\n", "speed = nan", "`gripper.speed` is nan: it must be finite"),
        ('sensor = "pinza"', 'sensor = "pinzas"', "sensor =", '"pinzas" is no [[sensor]]; did you mean "pinza"?'),
        ('sensor = "pinza"', 'sensor = "ultra"', "sensor =", '"ultra" is of kind ultrasonic'),
        ('unit = "mm"', 'unit = "V"', "sensor =", '"pinza" reads in "V": the opening is a length'),
        ('kind = "servo"', 'kind = "magnet"', "kind =", "Invalid value 'magnet'"),
        ("effort = 11.0\n", "", "[gripper]", "missing required field `effort`"),
    ],
)
def test_a_gripper_that_cannot_be_is_refused_with_its_line(copy: Path, old: str, new: str, key: str, sentence: str):
    edit(copy / "robot.toml", old, new)
    with pytest.raises(DescriptionError) as raised:
        load_arm(copy)
    assert sentence in str(raised.value)
    table = (copy / "robot.toml").read_text().index("[gripper]")
    text = (copy / "robot.toml").read_text()
    wanted = text[:table].count("\n") + 1 + text[table:].split(key)[0].count("\n")
    assert f"line {wanted}" in str(raised.value), str(raised.value)


@pytest.mark.parametrize("copy", ["parol6"], indirect=True)
def test_a_valve_on_an_output_that_is_not_there_is_named_with_the_nearest(copy: Path):
    edit(copy / "robot.toml", 'output = "gripper_valve"', 'output = "griper_valve"')
    with pytest.raises(DescriptionError, match=r'"griper_valve" is no \[\[output\]\]; did you mean "gripper_valve"\?'):
        load_arm(copy)


def test_a_pin_that_is_used_twice_is_found(copy: Path):
    edit(copy / "robot.toml", "pin = 14", "pin = 13")
    findings = [str(finding) for finding in check(copy)]
    assert any("pin 13" in text and "[gripper] pin" in text for text in findings), findings


def test_what_is_wrong_with_a_gripper_is_a_finding_of_the_check(copy: Path):
    edit(copy / "robot.toml", 'sensor = "pinza"', 'sensor = "ultra"')
    findings = [str(finding) for finding in check(copy)]
    assert any("is of kind ultrasonic" in text for text in findings), findings
