"""Speed limits from robot.toml: revolutions per minute of the output shaft, ramp and jerk time; and a tick for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.motors.steps import StepScale, step_scale
from gemelo.schemas.reasons import because
from gemelo.schemas.robot import Driver, RobotFile, StepperJoint

RANGES = {  # of what a builder can mean
    "max_speed_rpm": (1e-3, 1e6),  # [rev/min]
    "ramp_time": (1e-3, 1e3),  # [s]
    "jerk_time": (1e-3, 1e3),  # [s]
}

ROOM = 0.8  # of the highest rate possible that a joint may need
# [Hz] in the order of preference: the firmware's 50 kHz, faster, then slower for drivers that want long pulses.
RATES: tuple[int, ...] = (*range(50_000, 100_001, 10_000), 40_000, 30_000, 20_000, 10_000)


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
            what = because("robot.joint.range", key=key, value=value, least=least, most=most)
            raise DescriptionError(because("robot.joint", what, joint=drive.name))
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


def fastest_steps(driver: Driver, tick_hz: int) -> float:
    """[steps/s] that the driver's inputs and the device's tick allow."""
    tick = 1e6 / tick_hz  # [us]
    ticks = math.ceil(driver.step_high_us / tick - 1e-9) + math.ceil(driver.step_low_us / tick - 1e-9)
    return tick_hz / max(ticks, 1)


def chosen_tick(robot: RobotFile) -> int:
    """[Hz] of the device, where robot.toml gives none: for the joints' speeds and the drivers' pulses; the best where
    none is enough, which `gemelo check` says."""
    drivers = {driver.name: driver for driver in robot.driver}
    needs: list[tuple[float, Driver]] = []
    for drive in robot.joint:
        try:
            needs.append((float(speed_limits(drive).step_rate), drivers[drive.motor.driver]))
        except (DescriptionError, KeyError):
            continue  # said where the joint is read

    def room(tick_hz: int) -> float:
        return min((_room(rate, driver, tick_hz) for rate, driver in needs), default=1.0)

    return max(RATES, key=room)


def _room(rate: float, driver: Driver, tick_hz: int) -> float:
    """1 where all is well, less the more is missing; below 0 where a pulse is longer than the tick."""
    if 1e6 / tick_hz < max(driver.step_high_us, driver.step_low_us):
        return -1.0
    return min(1.0, ROOM * fastest_steps(driver, tick_hz) / rate)
