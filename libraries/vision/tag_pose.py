"""The pose of a square tag from its corners: both solutions, which of them it is, and how far off it may be.

A tag's frame has its origin in the middle, x to its right, y up and z out of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, angle_between, apply, from_opencv, rigid, solved, step
from gemelo.libraries.vision.tags import Tag

ROUNDS = 10
SETTLING = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 1e-9)
SETTLED = 1e-6  # [m] and [rad]: what is left after a step that is so small is far less
SAME = np.radians(1.0)  # [rad] between two solutions that are one


@dataclass(frozen=True)
class TagPose:
    """Where a tag stands."""

    camera_from_tag: Array  # (4, 4)
    other: Array  # (4, 4) the second solution, which looks nearly the same
    error: float  # [px] RMS reprojection error
    flip_ratio: float  # of the better solution's error to the other's: 1 cannot be told apart, 0 beyond doubt
    covariance: Array  # (6, 6) of a small turn [rad] and step [m] in the camera frame

    @property
    def sigma(self) -> float:
        """[m] standard deviation of the position."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:])))


def square(size: float) -> Array:
    """The corners (4, 3) of a tag whose edge is `size` [m], in its own frame."""
    half = size / 2.0
    return np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])


def tag_pose(tag: Tag, model: CameraModel, size: float, normal: Array | None = None) -> TagPose:
    """The pose of a tag whose edge is `size` [m]; of the two solutions the one whose z is nearer to `normal` (3,), a
    direction of the camera frame, or without it the one that fits better."""
    corners = square(size)
    found = cv2.solvePnPGeneric(corners, tag.ideal, model.matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    solutions = [
        from_opencv(*cv2.solvePnPRefineLM(corners, tag.ideal, model.matrix, None, *seed, SETTLING))
        for seed in zip(found[1], found[2], strict=True)
    ]
    errors = [rms(corners, tag.ideal, model, pose) for pose in solutions]
    order = np.argsort(errors)
    if normal is not None:
        order = np.argsort([-float(normal @ pose[:3, 2]) for pose in solutions])
    first, second = solutions[order[0]], solutions[order[1]]
    is_one = angle_between(first, second) < SAME
    flip_ratio = 0.0 if is_one or max(errors) == 0.0 else min(errors) / max(errors)
    return TagPose(
        first, second, errors[order[0]], flip_ratio, covariance_of(corners, tag.ideal, model, first, tag.sigma)
    )


def residuals(points: Array, ideal: Array, model: CameraModel, pose: Array) -> Array:
    """(2 n,) [px] of the points (n, 3) seen at `ideal` (n, 2)."""
    placed = apply(pose, points)
    return np.asarray((placed[:, :2] / placed[:, 2:] * model.focal + model.centre - ideal).ravel())


def jacobian(points: Array, model: CameraModel, pose: Array) -> Array:
    """(2 n, 6) of `residuals` by a small turn about the thing's origin and a step, both in the camera frame; at `pose`
    (4, 4), of `points` (n, 3) [m]."""
    placed = apply(pose, points)
    x, y, z = placed.T
    by_point = np.zeros((len(placed), 2, 3))
    by_point[:, 0, 0], by_point[:, 1, 1] = model.focal[0] / z, model.focal[1] / z
    by_point[:, 0, 2], by_point[:, 1, 2] = -model.focal[0] * x / z**2, -model.focal[1] * y / z**2
    a, b, c = (placed - pose[:3, 3]).T
    nothing = np.zeros(len(placed))
    by_turn = np.array([[nothing, c, -b], [-c, nothing, a], [b, -a, nothing]]).transpose(
        2, 0, 1
    )  # minus the cross product
    return np.concatenate((by_point @ by_turn, by_point), axis=2).reshape(-1, 6)


def moved(pose: Array, change: Array) -> Array:
    """The pose after a small turn about its origin and a step `change` (6,), both in the outer frame."""
    after = step(np.concatenate((change[:3], np.zeros(3)))) @ rigid(pose[:3, :3], np.zeros(3))
    after[:3, 3] = pose[:3, 3] + change[3:]
    return np.asarray(after)


def rms(points: Array, ideal: Array, model: CameraModel, pose: Array) -> float:
    """[px] root of the mean squared distance between `points` at `pose`, projected, and their `ideal` pixels."""
    return float(np.sqrt(np.sum(residuals(points, ideal, model, pose) ** 2) / len(points)))


def covariance_of(points: Array, ideal: Array, model: CameraModel, pose: Array, sigma: float) -> Array:
    """(6, 6) of a turn [rad] and a step [m], propagated from corners of `sigma` [px], or of what they are off."""
    slope = jacobian(points, model, pose)
    left = np.sum(residuals(points, ideal, model, pose) ** 2) / max(1, slope.shape[0] - 6)
    return np.asarray(cv2.invert(slope.T @ slope, flags=cv2.DECOMP_SVD)[1] * max(sigma**2, left), dtype=np.float64)


def plane_pose(tag: Tag, model: CameraModel, size: float, camera_from_plane: Array) -> tuple[Array, Array]:
    """The pose (4, 4) of a tag that lies face up on the plane z = 0 of `camera_from_plane`, and the covariance (3, 3)
    of its x, y [m] and turn [rad] on it."""
    seen = on_plane((tag.ideal - model.centre) / model.focal, camera_from_plane)
    x, y, _ = seen.mean(axis=0)
    east = seen[1] - seen[0]
    values = np.array([x, y, np.arctan2(east[1], east[0])])
    corners, motions = square(size), flat_motions(camera_from_plane)
    for _ in range(ROUNDS):
        pose = camera_from_plane @ flat(values)
        slope = jacobian(corners, model, pose) @ motions
        change = solved(slope.T @ slope, slope.T @ residuals(corners, tag.ideal, model, pose))
        values = values - change
        if np.abs(change).max() < SETTLED:
            break
    pose = camera_from_plane @ flat(values)
    slope = jacobian(corners, model, pose) @ motions
    return pose, np.asarray(np.linalg.inv(slope.T @ slope) * tag.sigma**2, dtype=np.float64)


def flat(values: Array) -> Array:
    """The pose (4, 4) on a plane of x, y [m] and a turn [rad] about its normal."""
    return rigid(np.array([0.0, 0.0, values[2]]), np.array([values[0], values[1], 0.0]))


def flat_motions(camera_from_plane: Array) -> NDArray[np.float64]:
    """(6, 3) turn and step in the camera frame for each of x, y and turn on the plane of `camera_from_plane` (4, 4)."""
    axes = camera_from_plane[:3, :3]
    motions = np.zeros((6, 3))
    motions[3:, 0], motions[3:, 1], motions[:3, 2] = axes[:, 0], axes[:, 1], axes[:, 2]
    return motions


def on_plane(rays: Array, camera_from_plane: Array) -> Array:
    """Where rays (n, 2) of the camera meet z = 0 of the plane: (n, 3) [m] in its frame."""
    normal, origin = camera_from_plane[:3, 2], camera_from_plane[:3, 3]
    directions = np.column_stack((rays, np.ones(len(rays))))
    reach = (normal @ origin) / (directions @ normal)
    return (directions * reach[:, None] - origin) @ camera_from_plane[:3, :3]


def turned_by(pose: Array) -> float:
    """[rad] by which a tag at `pose` (4, 4) in the camera frame is tilted away from facing the camera."""
    return float(np.arccos(np.clip(-pose[2, 2], -1.0, 1.0)))
