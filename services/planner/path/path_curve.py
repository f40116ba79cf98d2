"""Joint values by the length of a path, with their derivatives: a cubic spline, or lines with rounded corners."""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.curve import Derivatives

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
NEAR = 0.1  # of the blend: a point so near to the one before is passed with it; chosen: a tenth of what may be cut
NO_LENGTH = 1e-7  # [m] a leg that is shorter is none; chosen: far below a motor step


class PathCurve(Protocol):
    """Continuous in its second derivative; `knots` (j,) are where its third one jumps."""

    @property
    def knots(self) -> Array:
        """Ascending lengths (j,), in the unit of length of the path."""

    def at(self, along: Array) -> Derivatives:
        """The values (m, k) and their derivatives by the length, at lengths (m,) within the knots and in their unit."""


class CubicSpline:
    """Through `values` (m, k) at the ascending `knots` (m,), m >= 4; at its ends as steep as the cubic through four of
    them (Biagiotti and Melchiorri 2008, section 4.4)."""

    def __init__(self, knots: Array, values: Array) -> None:
        self.knots = knots
        self._h = np.diff(knots)[:, None]
        self._values = values
        self._slopes = self._solved(np.diff(values, axis=0) / self._h)

    def at(self, along: Array) -> Derivatives:
        """The values (m, k) and their derivatives by the length, at lengths (m,) within the knots and in their unit."""
        index = np.clip(np.searchsorted(self.knots, along, side="right") - 1, 0, len(self.knots) - 2)
        h, x = self._h[index], (along - self.knots[index])[:, None]
        start, slope = self._values[index], self._slopes[index]
        chord = (self._values[index + 1] - start) / h
        square = (3.0 * chord - 2.0 * slope - self._slopes[index + 1]) / h
        cube = (slope + self._slopes[index + 1] - 2.0 * chord) / (h * h)
        value = start + x * (slope + x * (square + x * cube))
        return Derivatives(
            value, slope + x * (2.0 * square + x * 3.0 * cube), 2.0 * square + x * 6.0 * cube, 6.0 * cube
        )

    def _solved(self, chords: Array) -> Array:
        """(m, k) the slopes that make the second derivative continuous: the tridiagonal system, after Thomas."""
        h = self._h[:, 0]
        slopes = np.empty_like(self._values)
        slopes[0] = _end_slope(self.knots[:4], self._values[:4])
        slopes[-1] = _end_slope(self.knots[-4:][::-1], self._values[-4:][::-1])
        right = 3.0 * (chords[:-1] * self._h[1:] + chords[1:] * self._h[:-1])
        upper, before = np.zeros(len(h)), slopes[0]
        for row in range(1, len(h)):
            pivot = 2.0 * (h[row - 1] + h[row]) - h[row] * upper[row - 1]
            upper[row] = h[row - 1] / pivot
            before = slopes[row] = (right[row - 1] - h[row] * before) / pivot
        for row in range(len(h) - 1, 0, -1):
            slopes[row] -= upper[row] * slopes[row + 1]
        return slopes


class RoundedLines:
    """Straight from row to row of `configurations` (m, n), corners cut at `radii` (m - 2,) of the length before and
    after."""

    def __init__(self, configurations: Array, lengths: Array, radii: Array) -> None:
        self.start, self.end = configurations[0], configurations[-1]
        self._corners = np.concatenate(([0.0], np.cumsum(lengths)))
        self._configurations = configurations
        self._directions = np.diff(configurations, axis=0) / lengths[:, None]
        self._radii = radii
        inner = self._corners[1:-1]
        self._between = 0.5 * (
            inner[1:] - radii[1:] + inner[:-1] + radii[:-1]
        )  # where one cut has ended, and the next not begun
        self.marks = np.unique(np.concatenate((inner - radii, inner + radii, self._corners[[0, -1]])))
        self.knots = np.unique(np.concatenate((self.marks, inner)))

    def at(self, along: Array) -> Derivatives:
        """The joint values (m, n) [rad] or [m] and their derivatives by the length, at lengths (m,) within the
        knots."""
        leg = np.clip(np.searchsorted(self._corners, along, side="right") - 1, 0, len(self._directions) - 1)
        first = self._directions[leg].copy()
        value = self._configurations[leg] + (along - self._corners[leg])[:, None] * first
        second, third = np.zeros_like(first), np.zeros_like(first)
        if len(self._radii):
            corner = np.clip(
                np.searchsorted(self._between, along), 0, len(self._radii) - 1
            )  # the nearest: cuts meet there
            offset, radius = along - self._corners[corner + 1], self._radii[corner]
            near = np.flatnonzero(np.abs(offset) < radius)
            corner, offset, radius = corner[near], offset[near, None], radius[near, None]
            coming, leaving = self._directions[corner], self._directions[corner + 1]
            width, change = 2.0 * radius, leaving - coming
            u = (offset + radius) / width
            value[near] = self._configurations[corner + 1] + offset * coming + width * blending(u) * change
            first[near] = coming + u * u * (3.0 - 2.0 * u) * change
            second[near] = 6.0 * u * (1.0 - u) / width * change
            third[near] = (6.0 - 12.0 * u) / width**2 * change
        return Derivatives(value, first, second, third)


def rounded_runs(configurations: Array, scale: Array, reach: Array, blend: float) -> list[RoundedLines]:
    """The polyline of `configurations` (m, n) as runs from rest to rest; its length is in `scale` (n,) units of the
    joints.

    A corner is cut only as far as no point of the arm leaves it by more than `blend` [m], by how far it can move at
    most per unit of each joint, `reach` (n,).
    """
    configurations = _apart(configurations, reach, NEAR * blend)
    lengths = np.linalg.norm(np.diff(configurations, axis=0) / scale, axis=1)
    keep = lengths > NO_LENGTH
    configurations, lengths = np.vstack((configurations[:1], configurations[1:][keep])), lengths[keep]
    if not len(lengths):
        return []
    movement = np.abs(np.diff(configurations, axis=0)) @ reach / lengths  # [m] per unit of length
    radii = [
        cut(float(lengths[i]), float(lengths[j]), blend / max(float(movement[i]), float(movement[j]), NO_LENGTH))
        for i, j in pairwise(range(len(lengths)))
    ]
    stops = [0, *(index + 1 for index, radius in enumerate(radii) if radius == 0.0), len(lengths)]
    return [
        RoundedLines(configurations[low : high + 1], lengths[low:high], np.array(radii[low : high - 1]))
        for low, high in pairwise(stops)
    ]


def _apart(configurations: Array, reach: Array, least: float) -> Array:
    """Without the rows (n,) at which no point of the arm is farther than `least` [m] from the row kept before."""
    if least <= 0.0:
        return configurations
    kept = [0]
    for row in range(1, len(configurations) - 1):
        if float(np.abs(configurations[row] - configurations[kept[-1]]) @ reach) > least:
            kept.append(row)
    return configurations[[*kept, len(configurations) - 1]]


def _end_slope(knots: Array, values: Array) -> Array:
    """Of the cubic through four points, at the first of them."""
    powers = (knots - knots[0])[1:, None] ** np.arange(1, 4)
    slope: Array = np.linalg.solve(powers, values[1:] - values[0])[0]
    return slope


def cut(before: float, after: float, blend: float) -> float:
    """Length from a corner at which the path may leave its two legs, of lengths `before` and `after`: at most `blend`;
    all are in the same unit. 0 where the path has to stop at the corner."""
    radius = min(blend, 0.5 * before, 0.5 * after)
    return radius if radius > NO_LENGTH else 0.0


def blending(u: float | Array) -> float | Array:
    """The integral of the step 3 u^2 - 2 u^3 from 0 to u, dimensionless: how far the second direction has taken
    over."""
    return u * u * u * (1.0 - 0.5 * u)
