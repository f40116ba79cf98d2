"""Joint values of a closed form, turned into the limits in every way that there is."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm

Array = NDArray[np.float64]

NEVER = 1e9  # [m] after which a slide would be where it was
MOST_TURNS = 64  # combinations of full turns of one branch
ROUNDING = 1e-9  # [rad] or [m] by which a solution may be beyond a limit before it is put onto it


class Turns:
    """For one arm; joint values are (n,) [rad] or [m] in the arm's order."""

    def __init__(self, arm: Arm) -> None:
        self._lower = np.array([joint.lower - ROUNDING for joint in arm.joints])
        self._upper = np.array([joint.upper + ROUNDING for joint in arm.joints])
        self._period = np.array([math.tau if joint.unit == "rad" else NEVER for joint in arm.joints])

    def within_limits(self, branches: Array, near: Array) -> list[Array]:
        """The branches (m, n) or one of them (n,) with every full turn; joints without limits as near as they can."""
        branches = np.atleast_2d(branches)
        lower = np.where(np.isinf(self._lower), near - 0.5 * self._period, self._lower)
        upper = np.where(np.isinf(self._upper), near + 0.5 * self._period, self._upper)
        first = branches + self._period * np.ceil((lower - branches) / self._period)
        more = np.floor((upper - first) / self._period)
        postures: list[Array] = []
        for values, turns in zip(first, more, strict=True):
            if turns.min() >= 0.0:  # false for what is not a number, too
                postures.extend(_turned(values, turns) if turns.any() else [values])
        return postures

    def nearly(self, branches: Array) -> tuple[Array, Array]:
        """The branches (m, n) with the full turns that bring them nearest to the limits, and by how much (m,) they
        miss those."""
        middle, half = 0.5 * (self._lower + self._upper), 0.5 * (self._upper - self._lower)
        middle = np.where(np.isfinite(middle), middle, 0.0)
        away = branches - middle
        away = away - self._period * np.rint(away / self._period)
        return middle + away, np.maximum(np.abs(away) - half, 0.0).max(axis=1)


def _turned(values: Array, turns: Array) -> list[Array]:
    """`values` with up to `turns` full turns added to each."""
    while np.prod(turns + 1.0) > MOST_TURNS:
        turns = np.minimum(turns, turns.max() - 1.0)
    amounts = product(*(range(int(most) + 1) for most in turns))
    return [values + math.tau * np.array(amount) for amount in amounts]
