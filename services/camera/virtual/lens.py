"""The ray of every sample of an image, through OpenCV's lens model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.camera import CameraInfo

Array = NDArray[np.float64]
Samples = NDArray[np.float32]

ITERATIONS, PRECISION = 100, 1e-12  # of the inversion of the distortion


@dataclass(frozen=True, eq=False)
class Lens:
    """`x`, `y` (h s, w s): where the ray of each sample pierces z = 1 of the optical frame, s samples a pixel's side.

    `x_range` (2, w s) has the least and greatest x of each column, `y_range` (2, h s) those of y of each row.
    """

    x: Samples
    y: Samples
    x_range: Samples
    y_range: Samples

    def window(self, low: Array, high: Array) -> tuple[slice, slice]:
        """Rows and columns outside of which no ray pierces z = 1 between the corners `low` and `high` (2,)."""
        return _span(self.y_range, low[1], high[1]), _span(self.x_range, low[0], high[0])


def lens_of(camera: CameraInfo, samples: int) -> Lens:
    """The rays of a camera, `samples` along each side of a pixel; kept for the next image of the same lens."""
    return _lens(camera.width, camera.height, camera.intrinsics, camera.distortion, samples)


@lru_cache(maxsize=8)
def _lens(width: int, height: int, intrinsics: tuple[float, ...], distortion: tuple[float, ...], samples: int) -> Lens:
    matrix = np.array(intrinsics).reshape(3, 3)
    u = (np.arange(width * samples) + 0.5) / samples - 0.5  # [px] a pixel's centre is a whole number
    v = (np.arange(height * samples) + 0.5) / samples - 0.5
    x, y = np.meshgrid((u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1])
    if any(distortion):
        x, y = _undistorted(x, y, np.array(distortion))
    x, y = x.astype(np.float32), y.astype(np.float32)
    return Lens(x, y, np.stack((x.min(0), x.max(0))), np.stack((y.min(1), y.max(1))))


def _undistorted(x: Array, y: Array, distortion: Array) -> tuple[Array, Array]:
    points = np.stack((x.ravel(), y.ravel()), axis=1).reshape(-1, 1, 2)
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, ITERATIONS, PRECISION)
    found = cv2.undistortPointsIter(points, np.eye(3), distortion, np.eye(3), np.eye(3), until).reshape(-1, 2)
    return found[:, 0].reshape(x.shape), found[:, 1].reshape(x.shape)


def _span(ranges: Samples, low: float, high: float) -> slice:
    within = np.flatnonzero((ranges[1] >= low) & (ranges[0] <= high))
    return slice(int(within[0]), int(within[-1]) + 1) if len(within) else slice(0, 0)
