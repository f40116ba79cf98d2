"""An arm to plan and look at only: robot.toml tells of no motor, and a virtual device is generated."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.check import Severity, check
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription, load_arm, require_motors
from gemelo.libraries.arm.motors.speed import ROOM, fastest_steps
from gemelo.schemas.deployment import DeviceKind
from tests.arm.bare_arm import write_bare_arm
from tests.arm.editing import edit

MOTOR = '[joint.motor]\ndriver = "A4988"\npulses_per_turn = 3200\n'


def test_no_motor_is_needed_and_the_joints_come_from_the_root_outwards(tmp_path: Path):
    arm = load_arm(write_bare_arm(tmp_path))
    assert not arm.has_motors
    assert arm.joint_names == ("turn", "reach"), "the finger follows and needs no motor"
    assert [joint.velocity for joint in arm.joints] == pytest.approx([3.0, 0.5])
    assert device_config(arm).name == "bare"


@pytest.mark.parametrize("velocity", [0.01, 1.0, 3.0, 6.3, 12.0, 40.0])
def test_steps_are_fine_and_the_tick_has_room_for_the_fastest_joint(tmp_path: Path, velocity: float):
    arm = load_arm(write_bare_arm(tmp_path, velocity=velocity))
    turn, reach = arm.joints
    assert turn.velocity == pytest.approx(velocity)
    assert turn.steps.resolution <= max(1e-4, velocity / 32_000.0 * 1.01)
    assert reach.steps.resolution <= 2e-5
    for joint in arm.joints:
        assert joint.velocity * joint.steps.per_unit <= ROOM * fastest_steps(joint.driver, arm.device.tick_hz) * 1.001
    assert not [finding for finding in check(tmp_path) if finding.severity is Severity.ERROR]


def test_check_says_that_there_are_no_motors_and_nothing_else_of_them(tmp_path: Path):
    (finding,) = check(write_bare_arm(tmp_path))
    assert finding.severity is Severity.NOTE
    assert "no motors: to plan and look at only" in finding.message


def test_a_joint_may_say_its_speed_without_a_motor(tmp_path: Path):
    arm = load_arm(write_bare_arm(tmp_path, '[[joint]]\nname = "reach"\nramp_time = 2.0\nmechanical_upper = 0.3\n'))
    assert arm.joint_names == ("reach", "turn"), "those named come first"
    assert arm.joint("reach").upper == 0.3
    assert arm.joint("reach").acceleration == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("robot", "has", "lacks"),
    [
        ('[device]\nname = "bare"\n', "[device]", ("[[driver]]", "[[joint]]")),
        (
            '[[driver]]\nname = "A4988"\nstep_high_us = 1\nstep_low_us = 1\ndir_setup_us = 1\n',
            "[[driver]]",
            ("[device]", "[[joint]]"),
        ),
        (
            f'[[joint]]\nname = "turn"\nwire_name = "q1"\n{MOTOR}[[joint]]\nname = "reach"\nwire_name = "q2"\n',
            "[joint.motor] (turn)",
            ("[device]", "[[driver]]", "[joint.motor] (reach)"),
        ),
        ('[[input]]\nname = "estop"\npin = 21\nrole = "estop"\n', "[[input]]", ("[device]",)),
    ],
)
def test_half_of_the_motors_is_an_error_that_says_what_is_missing(
    tmp_path: Path, robot: str, has: str, lacks: tuple[str, ...]
):
    write_bare_arm(tmp_path, robot)
    with pytest.raises(DescriptionError) as caught:
        load_arm(tmp_path)
    before, after = str(caught.value).split("but not")
    assert has in before
    assert all(word in after for word in lacks)
    (finding,) = check(tmp_path)
    assert finding.severity is Severity.ERROR
    assert str(caught.value) in str(finding)


def test_a_real_device_is_refused_with_what_to_write(tmp_path: Path, rm1: ArmDescription):
    arm = load_arm(write_bare_arm(tmp_path))
    require_motors(arm, DeviceKind.VIRTUAL)
    require_motors(rm1, DeviceKind.BOARD)
    with pytest.raises(DescriptionError, match=r"no motors.*\[device\], a \[\[driver\]\] and a \[joint.motor\]"):
        require_motors(arm, DeviceKind.BOARD)


def test_the_tick_is_chosen_from_the_joints_speeds_where_robot_toml_has_none(copy: Path):
    edit(copy / "robot.toml", "tick_hz = 50_000\n", "")
    assert load_arm(copy).device.tick_hz == 50_000
    edit(copy / "robot.toml", "pulses_per_turn = 400", "pulses_per_turn = 1600")  # 19 kHz at 15 RPM
    edit(copy / "robot.toml", "step_high_us = 5.0\nstep_low_us = 5.0", "step_high_us = 10.0\nstep_low_us = 10.0")
    assert load_arm(copy).device.tick_hz == 50_000
    edit(copy / "robot.toml", "pulses_per_turn = 1600", "pulses_per_turn = 2400")  # 28.0 kHz: 60 kHz leave room for 24
    assert load_arm(copy).device.tick_hz == 70_000
    assert not [finding for finding in check(copy) if finding.severity is Severity.ERROR]


@pytest.mark.parametrize("old", ["tick_hz = 50_000", 'name = "rm1"', "step_high_us = 5.0"])
def test_no_message_points_at_a_source_file(copy: Path, old: str):
    edit(copy / "robot.toml", old, f"{old.split(' = ')[0]} = []")
    said = "\n".join(map(str, check(copy)))
    assert ".py" not in said
    assert "error:" in said
