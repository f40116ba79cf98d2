"""Triangles cut by planes, and the corners of what the planes leave: with these a part of a solid is held whole.

Every extreme point of a solid within half-spaces is a corner of its clipped triangles, or one of the half-spaces'
common corners that is inside it. What is convex and holds all of these holds that part of the solid.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SAME = 1e-9  # [m] that a corner may be beyond a plane
PARALLEL = 1e-6  # the determinant of three normals below which their planes have no common corner


def clipped(corners: Array, normal: Array, offset: float) -> tuple[Array, NDArray[np.int64]]:
    """The parts (g, 3, 3) of triangles (f, 3, 3) [m] where `normal` (3,) times a point is at most `offset` [m], and
    the number (g,) of the triangle that each is of."""
    heights = heights_of(corners, normal) - offset
    below = heights <= 0.0
    count = below.sum(axis=1)
    numbers = np.arange(len(corners))
    one, two = numbers[count == 1], numbers[count == 2]
    lone, crossed = _crossings(corners, heights, one, below[one].argmax(axis=1))
    tip = np.stack((lone[:, 0], crossed[:, 0], crossed[:, 1]), axis=1)
    rest, cut = _crossings(corners, heights, two, (~below[two]).argmax(axis=1))
    first = np.stack((cut[:, 0], rest[:, 1], rest[:, 2]), axis=1)
    second = np.stack((cut[:, 0], rest[:, 2], cut[:, 1]), axis=1)
    whole = numbers[count == 3]
    return np.concatenate((corners[whole], tip, first, second)), np.concatenate((whole, one, two, two))


def heights_of(corners: Array, normal: Array) -> Array:
    """(f, 3) [m] of the corners of triangles (f, 3, 3) along a normal (3,)."""
    return np.asarray((corners.reshape(-1, 3) @ normal).reshape(-1, 3))  # one product of matrices


def _crossings(corners: Array, heights: Array, rows: NDArray[np.int64], lone: NDArray[np.int64]) -> tuple[Array, Array]:
    """Triangles (k, 3, 3) turned so that the corner on the one side comes first, and where the plane cuts the two edges
    at it (k, 2, 3)."""
    turned = (lone[:, None] + np.arange(3)) % 3
    points = np.take_along_axis(corners[rows], turned[:, :, None], axis=1)
    high = np.take_along_axis(heights[rows], turned, axis=1)
    share = high[:, :1] / (high[:, :1] - high[:, 1:])
    return points, points[:, :1] + share[:, :, None] * (points[:, 1:] - points[:, :1])


def common_corners(planes: Array) -> Array:
    """(n, 3) [m] where three of the half-spaces (m, 4) meet that all the others leave there; a row is a normal and what
    that times a point may be at most."""
    if len(planes) < 3:
        return np.zeros((0, 3))
    three = planes[list(combinations(range(len(planes)), 3))]
    three = three[np.abs(np.linalg.det(three[:, :, :3])) > PARALLEL]
    points = np.linalg.solve(three[:, :, :3], three[:, :, 3:])[:, :, 0]
    return np.asarray(points[(points @ planes[:, :3].T <= planes[:, 3] + SAME).all(axis=1)])
