"""A gripper that a hobby servo drives."""

from __future__ import annotations

from gemelo.schemas.grippers.gripper import GripperRecord, PulseDrive
from gemelo.schemas.robot_record import Pin, Positive, PulseWidth


class ServoGripper(GripperRecord, frozen=True, kw_only=True, tag_field="kind", tag="servo"):
    """A hobby servo on a pin: its two ends are given as pulses."""

    pin: Pin
    open_us: PulseWidth
    closed_us: PulseWidth
    speed: Positive  # [m/s] of the opening; slower than the servo turns by itself
    sensor: str = ""  # name of an analog [[sensor]] in mm or m that reads the opening; empty: it is not measured
    off_at_estop: bool = False  # the pulses end: what it holds falls

    @property
    def drive(self) -> PulseDrive:
        return PulseDrive(
            pin=self.pin,
            open=self.open,
            closed=self.closed,
            open_us=self.open_us,
            closed_us=self.closed_us,
            speed=self.speed,
            sensor=self.sensor,
            off_at_estop=self.off_at_estop,
        )
