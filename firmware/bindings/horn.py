"""The virtual servo that a gripper of robot.toml hangs on."""

from __future__ import annotations

from collections.abc import Sequence

from firmware.bindings.library import HornRecord
from schemas.device_config import UNUSED, SensorConfig
from schemas.robot import ServoGripper
from services.arm.model.gripper import METRES, pulse_speed

MARGIN = 1.25  # a servo turns faster than it is asked to


def horn_record(gripper: ServoGripper, sensors: Sequence[SensorConfig], unit: str = "mm") -> HornRecord:
    """The core's form of it; `unit` is that of the sensor that reads the opening."""
    names = [sensor.name for sensor in sensors]
    return HornRecord(
        speed_us_s=pulse_speed(gripper) * MARGIN,
        open_us=gripper.open_us,
        closed_us=gripper.closed_us,
        open_value=gripper.open / METRES[unit],
        closed_value=gripper.closed / METRES[unit],
        sensor=names.index(gripper.sensor) if gripper.sensor in names else UNUSED,
    )
