"""The device's tick rate, where robot.toml does not give one: chosen so that every joint's step rate has room."""

from __future__ import annotations

import math

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.motors.speed import speed_limits
from gemelo.schemas.robot import Driver, RobotFile

ROOM = 0.8  # of the highest rate possible that a joint may need
# [Hz] in the order of preference: the firmware's 50 kHz, faster, then slower for drivers that want long pulses.
RATES: tuple[int, ...] = (*range(50_000, 100_001, 10_000), 40_000, 30_000, 20_000, 10_000)


def fastest_steps(driver: Driver, tick_hz: int) -> float:
    """[steps/s] that the driver's inputs and the device's tick allow."""
    tick = 1e6 / tick_hz  # [us]
    ticks = math.ceil(driver.step_high_us / tick - 1e-9) + math.ceil(driver.step_low_us / tick - 1e-9)
    return tick_hz / max(ticks, 1)


def chosen_tick(robot: RobotFile) -> int:
    """[Hz] for the joints' speeds and the drivers' pulses; the best where none is enough, which `gemelo check` says."""
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
