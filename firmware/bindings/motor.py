"""The virtual motor and servo: what a joint and a gripper hang on; and one motor that pulses are given to by hand."""

from __future__ import annotations

import ctypes as c
from collections.abc import Sequence

from gemelo.firmware.bindings.library import MAX_CURVE, HornRecord, MotorRecord, load_library
from gemelo.libraries.arm.model.gripper import METRES, pulse_speed
from gemelo.schemas.device_config import UNUSED, SensorConfig
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.robot import Motor

MARGIN = 1.25  # a servo turns faster than it is asked to


class MotorError(ValueError):
    """No such motor can be; the message says what is wrong with it."""


def motor_record(motor: Motor) -> MotorRecord:
    """The core's form of it; one without a pull-out curve is ideal."""
    record = MotorRecord(pulses_per_turn=motor.pulses_per_turn, full_steps_per_turn=200, points=0)
    curve = motor.pull_out
    if curve is None:
        return record
    count = len(curve.speed)
    if count != len(curve.torque) or not 1 <= count <= MAX_CURVE:
        raise MotorError(f"pull_out has {count} speeds and {len(curve.torque)} torques: 1 to {MAX_CURVE} of each")
    record.full_steps_per_turn, record.points = curve.full_steps_per_turn, count
    record.speed[:count], record.torque[:count] = curve.speed, curve.torque
    record.inertia, record.friction = curve.inertia, curve.friction
    return record


def horn_record(drive: PulseDrive, sensors: Sequence[SensorConfig], unit: str = "mm") -> HornRecord:
    """The core's form of a servo; `unit` is that of the sensor that reads the opening."""
    names = [sensor.name for sensor in sensors]
    return HornRecord(
        speed_us_s=pulse_speed(drive) * MARGIN,
        open_us=drive.open_us,
        closed_us=drive.closed_us,
        open_value=drive.open / METRES[unit],
        closed_value=drive.closed / METRES[unit],
        sensor=names.index(drive.sensor) if drive.sensor in names else UNUSED,
    )


class VirtualMotor:
    """A motor on a bench, at its place 0."""

    def __init__(self, motor: Motor, tick_hz: int = 50_000) -> None:
        self._library = load_library()
        self._tick_hz = tick_hz
        self._ticks = 0
        self._handle = self._library.gemelo_motor_create(c.byref(motor_record(motor)), 1.0 / tick_hz)

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self._library.gemelo_motor_destroy(self._handle)

    def run(self, until: float) -> None:
        """Let time pass until then [s]."""
        ticks = round(until * self._tick_hz)
        self._library.gemelo_motor_run(self._handle, max(0, ticks - self._ticks))
        self._ticks = max(self._ticks, ticks)

    def pulse(self, direction: int) -> None:
        """One step pulse, now; `direction` is 1 or -1."""
        self._library.gemelo_motor_pulse(self._handle, direction)

    def hold(self, held: bool = True) -> None:
        """Hold the shaft fast, or let it go."""
        self._library.gemelo_motor_hold(self._handle, held)

    @property
    def shaft(self) -> int:
        """The true shaft position [pulses]."""
        return int(self._library.gemelo_motor_shaft(self._handle))
