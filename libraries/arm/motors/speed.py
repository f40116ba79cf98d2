"""Speed limits from robot.toml: revolutions per minute of the output shaft, ramp time and jerk time."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.motors.steps import StepScale, step_scale
from gemelo.schemas.robot import StepperJoint

RANGES = {  # of what a builder can mean
    "max_speed_rpm": (1e-3, 1e6),  # [rev/min]
    "ramp_time": (1e-3, 1e3),  # [s]
    "jerk_time": (1e-3, 1e3),  # [s]
}


@dataclass(frozen=True)
class SpeedLimits:
    """The speed limits of one joint, in steps (exact) and in its own unit."""

    step_rate: Fraction  # [steps/s]
    step_acceleration: Fraction  # [steps/s^2]
    velocity: float  # [rad/s] or [m/s]
    acceleration: float  # [rad/s^2] or [m/s^2]
    jerk: float  # [rad/s^3] or [m/s^3]


def step_rate(rpm: float, scale: StepScale) -> Fraction:
    """[steps/s] at `rpm` of the output shaft: RPM x steps per turn / 60."""
    return Fraction(rpm) * scale.steps_per_turn / 60


def speed_limits(drive: StepperJoint) -> SpeedLimits:
    """The limits of one joint of robot.toml; raises `DescriptionError` naming the joint and the key."""
    for key, (least, most) in RANGES.items():
        value = getattr(drive, key)
        if not least <= value <= most:
            raise DescriptionError(f'joint "{drive.name}": {key} is {value}, it must be {least:g} to {most:g}')
    scale = step_scale(drive)
    rate = step_rate(drive.max_speed_rpm, scale)
    velocity = drive.max_speed_rpm / 60.0 * scale.travel_per_turn
    acceleration = velocity / drive.ramp_time
    return SpeedLimits(
        step_rate=rate,
        step_acceleration=rate / Fraction(drive.ramp_time),
        velocity=velocity,
        acceleration=acceleration,
        jerk=acceleration / drive.jerk_time,
    )
