"""Bounds of the movement along a path, under which no limited quantity exceeds its own limits.

With q(s) the path by its length s and v, a, j the velocity, acceleration and jerk of s:
q' = q_s v, q'' = q_ss v^2 + q_s a, q''' = q_sss v^3 + 3 q_ss v a + q_s j (Biagiotti and Melchiorri 2008, section 9.1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PathDerivatives(NamedTuple):
    """(m, k) each: absolute derivatives of the limited quantities by the length of the path."""

    first: Array
    second: Array
    third: Array


class QuantityLimits(NamedTuple):
    """(k,) each: limits of the quantities, in their own units per s, s^2 and s^3."""

    velocity: Array
    acceleration: Array
    jerk: Array


def speed_bound(path: PathDerivatives, limits: QuantityLimits, bending: float, twisting: float) -> Array:
    """(m, k) the highest v that each quantity allows; NaN or infinite where it does not depend on s.

    `bending` is the share of its acceleration limit for q_ss v^2, `twisting` that of its jerk limit for q_sss v^3.
    """
    straight = limits.velocity / path.first
    bent = np.sqrt(bending * limits.acceleration / path.second)
    twisted = np.cbrt(twisting * limits.jerk / path.third)
    return np.asarray(np.fmin(np.fmin(straight, bent), twisted))


def acceleration_bound(path: PathDerivatives, limits: QuantityLimits, speed: Array, crossing: float) -> Array:
    """(m, k) the highest a at `speed` (m, 1); `crossing` is the share of the jerk limit for 3 q_ss v a."""
    left = (limits.acceleration - path.second * speed * speed) / path.first
    return np.asarray(np.fmin(left, crossing * limits.jerk / crossing_term(path, speed, 1.0)))


def jerk_bound(path: PathDerivatives, limits: QuantityLimits, speed: Array, crossed: Array) -> Array:
    """(m, k) the highest jerk j along the path, in its unit of length per s^3, at `speed` (m, 1), where the term 3 q_ss
    v a takes `crossed` (m, k) of the jerk limit."""
    return np.asarray((limits.jerk - path.third * speed**3 - crossed) / path.first)


def crossing_term(path: PathDerivatives, speed: Array, acceleration: Array | float) -> Array:
    """(m, k) the jerk 3 q_ss v a of accelerating in a bend, in the quantities' own units per s^3, at `speed` (m, 1) and
    `acceleration` (m, 1)."""
    return np.asarray(3.0 * path.second * speed * acceleration)
