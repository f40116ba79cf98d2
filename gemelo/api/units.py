"""Conversion of the units that a person thinks in to those of the API: radians, metres and seconds."""

from __future__ import annotations

import math
from typing import NamedTuple

from gemelo.libraries.arm.frames.transforms import from_message, from_rpy, rotate
from gemelo.schemas.frames import Transform

Point = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def deg(value: float) -> float:
    """From `value` [deg] to [rad].

    >>> round(gemelo.deg(30), 4)
    0.5236
    """
    return math.radians(value)


def mm(value: float) -> float:
    """From `value` [mm] to [m].

    >>> gemelo.mm(250)
    0.25
    """
    return value / 1000.0


class Pose(NamedTuple):
    """Where a frame is: `position` (x, y, z) [m] and `orientation`, a unit quaternion (x, y, z, w).

    >>> gemelo.Pose((0.25, 0.15, 0.10)).orientation
    (0.0, 0.0, 0.0, 1.0)
    """

    position: Point
    orientation: Quaternion = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_rpy(cls, position: Point, roll: float, pitch: float, yaw: float) -> Pose:
        """A pose turned by roll, pitch and yaw [rad] about the fixed axes x, y and z, as in a URDF.

        >>> gemelo.Pose.from_rpy((0.2, 0.0, 0.1), 0.0, 0.0, gemelo.deg(180)).orientation[2]
        1.0
        """
        return cls(position, from_rpy(roll, pitch, yaw))

    def offset(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
        """The pose moved by `x`, `y`, `z` [m] along the axes of the frame that it is given in; turned as before.

        >>> gemelo.Pose((0.25, 0.0, 0.25)).offset(z=0.5).position
        (0.25, 0.0, 0.75)
        """
        a, b, c = self.position
        return Pose((a + x, b + y, c + z), self.orientation)

    def axis(self, along: Point = (0.0, 0.0, 1.0)) -> Point:
        """The direction of the pose's own axis `along` (x, y, z), a unit vector in the frame that the pose is given in.

        >>> gemelo.Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)).axis()
        (0.0, 0.0, -1.0)
        """
        return rotate(self.orientation, along)


def pose_from(transform: Transform) -> Pose:
    """The transform of a message."""
    return Pose(*from_message(transform))
