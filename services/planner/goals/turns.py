"""Joint values of a closed form, turned into the limits in every way that there is."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm

Array = NDArray[np.float64]

MOST_TURNS = 64  # combinations of full turns of one branch
ROUNDING = 1e-9  # [rad] or [m] by which a solution may be beyond a limit before it is put onto it


class Turns:
    """For one arm; joint values are (n,) [rad] or [m] in the arm's order."""

    def __init__(self, arm: Arm) -> None:
        self._lower = np.array([joint.lower - ROUNDING for joint in arm.joints])
        self._upper = np.array([joint.upper + ROUNDING for joint in arm.joints])
        self._does_turn = np.array([joint.unit == "rad" for joint in arm.joints])

    def within_limits(self, branches: Array, near: Array) -> list[Array]:
        """The branches (m, n) or one of them (n,) with every full turn; joints without limits as near as they can."""
        branches = np.atleast_2d(branches)
        lower = np.where(np.isinf(self._lower), near - math.pi, self._lower)
        upper = np.where(np.isinf(self._upper), near + math.pi, self._upper)
        first = branches + math.tau * np.where(self._does_turn, np.ceil((lower - branches) / math.tau), 0.0)
        more = np.floor((upper - first) / math.tau)
        more = np.where(self._does_turn, more, np.where((first >= lower) & (first <= upper), 0.0, -1.0))
        postures: list[Array] = []
        for values, turns in zip(first, more, strict=True):
            if turns.min() >= 0.0:  # false for what is not a number, too
                postures.extend(_turned(values, turns) if turns.any() else [values])
        return postures


def _turned(values: Array, turns: Array) -> list[Array]:
    """`values` with up to `turns` full turns added to each."""
    while np.prod(turns + 1.0) > MOST_TURNS:
        turns = np.minimum(turns, turns.max() - 1.0)
    amounts = product(*(range(int(most) + 1) for most in turns))
    return [values + math.tau * np.array(amount) for amount in amounts]
