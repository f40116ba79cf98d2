"""Results of the native planner: a free path, or the reason why none was found."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class FailureReason(IntEnum):
    """Why there is no path; as plan.h numbers it."""

    START_TOUCHES = 1
    GOAL_TOUCHES = 2
    TIMED_OUT = 3
    CANCELLED = 4


class Effort(NamedTuple):
    """What it took: [s] of each phase, samples of the search, configurations checked."""

    search: float
    shorten: float
    smooth: float
    iterations: int
    checks: int


class NoPath(NamedTuple):
    """None was found."""

    reason: FailureReason
    effort: Effort


class FreePath(NamedTuple):
    """A free path: `corners` (m, n) of the polyline, and `control` (k, n) points of the curve in its place.

    The curve is the uniform cubic B-spline of the control points, twice continuously differentiable in its parameter,
    from 0 to k - 3; both of its ends are control points three times, so that it begins and ends exactly there.
    """

    corners: Array
    control: Array
    shares: Array  # (m,) of its edges, how far the curve cuts each corner; 0 where it goes to the corner itself
    effort: Effort

    @property
    def spans(self) -> int:
        """The curve's parameter goes from 0 to this."""
        return len(self.control) - 3

    def at(self, parameters: Array) -> tuple[Array, Array, Array]:
        """Positions (m, n) [rad] or [m], first and second derivatives by the parameter, at the dimensionless
        `parameters` (m,) from 0 to k - 3."""
        span = np.clip(np.floor(parameters).astype(int), 0, self.spans - 1)
        u = (parameters - span)[:, None]
        v = 1.0 - u
        points = [self.control[span + k] for k in range(4)]
        position = (v**3, 3 * u**3 - 6 * u**2 + 4, 3 * v**3 - 6 * v**2 + 4, u**3)
        slope = (-(v**2), 3 * u**2 - 4 * u, -3 * v**2 + 4 * v, u**2)
        bend = (v, 3 * u - 2, 3 * v - 2, u)
        return (
            sum_of(position, points) / 6.0,
            sum_of(slope, points) / 2.0,
            sum_of(bend, points),
        )


def sum_of(weights: tuple[Array, ...], points: list[Array]) -> Array:
    """The sum (m, n) of points (m, n), each times its dimensionless weight (m, 1)."""
    total: Array = np.sum([weight * point for weight, point in zip(weights, points, strict=True)], axis=0)
    return total
