"""A motor: a driver and a `[joint.motor]` of robot.toml; no file of the code knows it."""

from __future__ import annotations

import shutil
from math import pi
from pathlib import Path

import pytest

import gemelo
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from tests.arm.editing import edit

ROOT = Path(__file__).parents[2]
DRIVER = """[[driver]]
name = "TMC2209"
step_high_us = 0.1
step_low_us = 0.1
dir_setup_us = 0.02

"""
OLD = """[joint.motor]
driver = "DM542T"
pulses_per_turn = 400
gear_ratio = "46.656"
"""
NEW = """[joint.motor]
driver = "TMC2209"
pulses_per_turn = 3200
gear_ratio = "27"
"""
OLD_CURVE = "speed = [0, 1000, 2000, 4000, 6000, 8000, 10000]"
NEW_CURVE = "speed = [0, 8000, 16000, 32000, 48000, 64000, 80000]"  # [steps/s] sixteenths instead of halves
STEPS_PER_TURN = 3200 * 27


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """rm1 with a smaller geared motor in sixteenths of a step behind another driver, on its first joint."""
    folder = tmp_path_factory.mktemp("arms") / "rm1"
    shutil.copytree(ROOT / "urdf/rm1", folder)
    edit(folder / "robot.toml", "[[driver]]\n", f"{DRIVER}[[driver]]\n")
    edit(folder / "robot.toml", OLD, NEW)
    edit(folder / "robot.toml", OLD_CURVE, NEW_CURVE)
    return folder


def test_its_steps_are_exact_and_the_board_gets_the_drivers_times(robot: Path) -> None:
    arm = load_arm(robot)
    assert arm.joints[0].steps.steps_per_turn == STEPS_PER_TURN
    assert device_config(arm).joints[0].dir_setup_us == 1  # the driver's 20 ns, in whole microseconds


def test_the_arm_moves_on_its_steps_and_ends_within_half_of_one(robot: Path) -> None:
    with gemelo.simulate(str(robot)) as arm:
        motion = arm.move(joints={"brazo_joint": 1.0})
        assert motion.result.executed_steps == motion.result.commanded_steps
        assert max(map(abs, arm.step_errors.values())) <= 0.5
        assert arm.joints["brazo_joint"] == pytest.approx(1.0, abs=pi / STEPS_PER_TURN)


def test_a_driver_that_is_not_there_is_named_with_its_joint(robot: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "rm1"
    shutil.copytree(robot, wrong)
    edit(wrong / "robot.toml", 'driver = "TMC2209"', 'driver = "TMC2290"')
    with pytest.raises(DescriptionError, match=r'brazo_joint.*there is no \[\[driver\]\] "TMC2290"'):
        load_arm(wrong)
