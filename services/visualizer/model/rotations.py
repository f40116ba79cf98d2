"""Quaternions (x, y, z, w), many at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def quaternion(roll: float, pitch: float, yaw: float) -> Array:
    """Fixed-axis roll, pitch, yaw in rad -> quaternion (x, y, z, w), as in URDF."""
    turns = []
    for axis, angle in enumerate((roll, pitch, yaw)):
        turn = np.zeros(4)
        turn[axis], turn[3] = np.sin(angle / 2), np.cos(angle / 2)
        turns.append(turn)
    return multiply(multiply(turns[2], turns[1]), turns[0])


def multiply(left: Array, right: Array) -> Array:
    """Product (..., 4) of the quaternions `left` and `right` (..., 4)."""
    x1, y1, z1, w1 = np.moveaxis(left, -1, 0)
    x2, y2, z2, w2 = np.moveaxis(right, -1, 0)
    return np.stack(
        [
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        ],
        axis=-1,
    )


def rotate(rotation: Array, point: Array) -> Array:
    """Point (..., 3) turned by quaternions (..., 4)."""
    vector, scalar = rotation[..., :3], rotation[..., 3:]
    cross = np.cross(vector, point)
    return np.asarray(point + 2.0 * (scalar * cross + np.cross(vector, cross)))
