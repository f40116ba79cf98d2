"""Rigid transforms as matrices (4, 4), for least squares on poses; lengths in [m], angles in [rad]."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.frames import Transform

Array = NDArray[np.float64]


def from_opencv(turned: NDArray[Any], place: NDArray[Any]) -> Array:
    """The matrix (4, 4) of OpenCV's rotation vector (3, 1) and translation (3, 1)."""
    return rigid(np.asarray(turned, dtype=np.float64)[:, 0], np.asarray(place, dtype=np.float64)[:, 0])


def rigid(rotation: Array, translation: Array) -> Array:
    """The matrix (4, 4) of a rotation (3, 3), or of a rotation vector (3,), and a translation (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation if rotation.shape == (3, 3) else turn(rotation)
    matrix[:3, 3] = translation
    return matrix


def turn(vector: Array) -> Array:
    """The rotation (3, 3) of a rotation vector (3,)."""
    return np.asarray(cv2.Rodrigues(np.asarray(vector, float).reshape(3, 1))[0], dtype=np.float64)


def turn_vector(rotation: Array) -> Array:
    """The rotation vector (3,) of a rotation (3, 3)."""
    return np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)[:, 0]


def step(vector: Array) -> Array:
    """The small transform (4, 4) of a step (6,): a rotation vector, then a translation."""
    return rigid(vector[:3], vector[3:])


def inverse(matrix: Array) -> Array:
    """b_T_a (4, 4) of the `matrix` a_T_b (4, 4)."""
    back = matrix[:3, :3].T
    return rigid(back, -back @ matrix[:3, 3])


def apply(matrix: Array, points: Array) -> Array:
    """`points` (n, 3) of the inner frame in the outer frame of `matrix` (4, 4)."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def angle_between(first: Array, second: Array) -> float:
    """[rad] between two rotations (3, 3) or transforms (4, 4)."""
    return float(np.linalg.norm(turn_vector(first[:3, :3].T @ second[:3, :3])))


def skew(vector: Array) -> Array:
    """The matrix (3, 3) of the cross product with a vector (3,)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def solved(normal: Array, right: Array) -> Array:
    """The least x (n,) of `normal` (n, n) @ x = `right` (n,); for a small n OpenCV is far faster than numpy."""
    return np.asarray(cv2.solve(normal, right, flags=cv2.DECOMP_SVD)[1], dtype=np.float64)[:, 0]


def from_transform(transform: Transform) -> Array:
    """The matrix (4, 4) of a message."""
    x, y, z, w = np.asarray(transform.rotation, float) / np.linalg.norm(transform.rotation)
    cross = skew(np.array([x, y, z]))
    return rigid(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross, np.asarray(transform.translation, float))


def to_transform(matrix: Array) -> Transform:
    """The message of a matrix (4, 4)."""
    vector = turn_vector(matrix[:3, :3])
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > 0.0 else vector
    x, y, z = (float(value) for value in np.sin(angle / 2.0) * axis)
    tx, ty, tz = (float(value) for value in matrix[:3, 3])
    return Transform(translation=(tx, ty, tz), rotation=(x, y, z, float(np.cos(angle / 2.0))))
