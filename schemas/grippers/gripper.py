"""The keys that every [gripper] of robot.toml has, and the two ways in which the controller board drives one."""

from __future__ import annotations

import msgspec

from gemelo.schemas.reasons import Reason
from gemelo.schemas.robot_record import Edges, NotNegative, Positive, RobotRecord


class PulseDrive(msgspec.Struct, frozen=True, kw_only=True):
    """By the device's command SERVO: 50 pulses a second on a pin, whose length the opening follows in proportion."""

    pin: int
    open: float  # [m]
    closed: float  # [m]
    open_us: int  # [us]
    closed_us: int  # [us]
    speed: float  # [m/s] of the opening
    sensor: str = ""  # name of an analog [[sensor]] in mm or m that reads the opening; empty: it is not measured
    off_at_estop: bool = False  # the pulses end: what it holds falls


class SwitchDrive(msgspec.Struct, frozen=True, kw_only=True):
    """By the device's command OUTPUT: open or closed, and only its travel time tells when it is there."""

    output: str  # name of an [[output]]
    open: float  # [m]
    closed: float  # [m]
    closes: bool = True  # False: switched on, it opens
    travel_time: float  # [s] from one end to the other


Drive = PulseDrive | SwitchDrive


class GripperRecord(RobotRecord, frozen=True, kw_only=True):
    """What every kind of gripper has. Openings are between the jaws.

    A kind is a file of its own beside this one, and a row of `kinds.Gripper`: its keys, `drive` (what the board is told
    to drive, of one without a fault), and `fault`.
    """

    open: Positive  # [m]
    closed: NotNegative = 0.0  # [m]
    effort: Positive  # [N] that it closes with, by its data sheet: nothing measures it
    tolerance: Positive = 0.001  # [m] from the goal that counts as there
    jaw: Edges | None = None  # of one jaw, in the tool frame: along x, along y (the way it moves), beyond it along z

    def fault(self) -> tuple[str, Reason | str]:
        """The key of this kind that is wrong, and why with the remedy; both empty if none is. What depends on `drive`
        alone is looked at for all kinds."""
        return "", ""
