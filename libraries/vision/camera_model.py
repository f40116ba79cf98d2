"""The pinhole model with OpenCV's distortion (k1, k2, p1, p2, k3): from points to pixels and from pixels to rays.

The optical frame has z forward, x right and y down; a pixel's centre has whole coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.windows import Window
from gemelo.schemas.camera import CameraInfo

Array = NDArray[np.float64]

SETTLED = 1e-5  # of a ray: what is left after a step of Newton's that is so small is about its square
ITERATIONS = 20  # of the inverse distortion; 4 suffice for lenses of 90 degrees


@dataclass(frozen=True)
class CameraModel:
    """One camera's lens."""

    matrix: Array  # (3, 3) [px]
    distortion: Array  # (5,)
    width: int  # [px]
    height: int  # [px]

    @cached_property
    def focal(self) -> Array:
        """(2,) [px]"""
        return np.array([self.matrix[0, 0], self.matrix[1, 1]])

    @cached_property
    def centre(self) -> Array:
        """(2,) [px]"""
        return np.array([self.matrix[0, 2], self.matrix[1, 2]])

    @cached_property
    def is_distorted(self) -> bool:
        return bool(self.distortion.any())

    def within(self, window: Window) -> CameraModel:
        """The same lens, for the part of its image that the window shows."""
        matrix = self.matrix.copy()
        matrix[:2, 2] -= window.left, window.top
        return CameraModel(matrix, self.distortion, window.width, window.height)

    def project(self, points: Array) -> Array:
        """The pixels (n, 2) of points (n, 3) [m] of the optical frame."""
        return self.pixels(points[:, :2] / points[:, 2:])

    def pixels(self, rays: Array) -> Array:
        """The pixels (n, 2) of rays (n, 2), the x / z and y / z of the optical frame."""
        return self._distorted(rays) * self.focal + self.centre

    def rays(self, pixels: Array) -> Array:
        """The rays (n, 2) of pixels (n, 2): the inverse of `pixels`, by Newton's method."""
        seen = (np.asarray(pixels, float) - self.centre) / self.focal
        if not self.is_distorted:
            return seen
        k1, k2, p1, p2, k3 = self.distortion
        u, v = seen[..., 0], seen[..., 1]
        x, y = u.copy(), v.copy()
        for _ in range(ITERATIONS):
            xx, xy, yy = x * x, x * y, y * y
            r2 = xx + yy
            radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
            rising = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3)))  # of `radial`, by half of the squared radius
            off_x = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx) - u
            off_y = y * radial + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy - v
            by_x = radial + xx * rising + 2.0 * p1 * y + 6.0 * p2 * x
            by_y = radial + yy * rising + 6.0 * p1 * y + 2.0 * p2 * x
            across = xy * rising + 2.0 * (p1 * x + p2 * y)
            divisor = by_x * by_y - across * across
            change_x = (off_x * by_y - off_y * across) / divisor
            change_y = (off_y * by_x - off_x * across) / divisor
            x -= change_x
            y -= change_y
            if max(np.abs(change_x).max(initial=0.0), np.abs(change_y).max(initial=0.0)) < SETTLED:
                break
        return np.stack((x, y), axis=-1)

    def ideal(self, pixels: Array) -> Array:
        """Where the pixels (n, 2) would lie without distortion [px]."""
        return self.rays(pixels) * self.focal + self.centre

    def real(self, ideal: Array) -> Array:
        """The pixels (n, 2) that `ideal` maps to `ideal` (n, 2)."""
        return self.pixels((ideal - self.centre) / self.focal)

    def _distorted(self, rays: Array) -> Array:
        if not self.is_distorted:
            return np.asarray(rays, float)
        k1, k2, p1, p2, k3 = self.distortion
        x, y = rays[..., 0], rays[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        distorted = np.empty(np.shape(rays))
        distorted[..., 0] = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        distorted[..., 1] = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        return distorted


def model_of(info: CameraInfo) -> CameraModel:
    """The model that a message tells; ValueError where it tells none."""
    if len(info.intrinsics) != 9:
        raise ValueError(f'camera "{info.name}": intrinsics have {len(info.intrinsics)} numbers, not 9')
    if len(info.distortion) not in (0, 5):
        raise ValueError(f'camera "{info.name}": distortion has {len(info.distortion)} numbers, not 0 or 5')
    distortion = np.array(info.distortion or (0.0,) * 5)
    return CameraModel(np.reshape(info.intrinsics, (3, 3)), distortion, info.width, info.height)


def of_field_of_view(angle: float, width: int, height: int) -> CameraModel:
    """A camera without distortion whose horizontal field of view is `angle` [rad]."""
    focal = width / 2.0 / np.tan(angle / 2.0)
    matrix = np.array([[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]])
    return CameraModel(matrix, np.zeros(5), width, height)
