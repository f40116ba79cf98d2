"""Decides if any path exists, for arms of few joints: a grid of configurations, joined where the line is free."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from services.arm.model.description import Arm
from services.planner.path.validity import ValidityChecker

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

STEP = 0.03  # [m] largest movement of any point of the arm between neighbours
NOWHERE = -1  # number of a configuration that is not free


class JointGrid:
    """A grid of configurations within the joint limits, and which of them can be reached from which."""

    def __init__(self, arm: Arm, reach: Array, validity: ValidityChecker) -> None:
        """`reach` (n,) is the largest movement [m] of any point of the arm per unit of each joint."""
        self._axes = [
            np.linspace(joint.lower, joint.upper, 2 + int((joint.upper - joint.lower) * most / STEP))
            for joint, most in zip(arm.joints, reach.tolist(), strict=True)
        ]
        self._validity = validity
        self._shape = tuple(len(axis) for axis in self._axes)
        self._rows = np.stack(np.meshgrid(*self._axes, indexing="ij"), axis=-1)
        rows = self._rows.reshape(-1, len(self._axes))
        self._free = np.array([validity.is_free(row) for row in rows]).reshape(self._shape)
        self._islands = islands(self._free, [self._joined(axis) for axis in range(len(self._axes))])

    def is_connected(self, start: Array, goal: Array) -> bool:
        """True if a path along the grid joins the configurations `start` and `goal` (n,) [rad] or [m]."""
        return not self._islands_at(start).isdisjoint(self._islands_at(goal))

    def _islands_at(self, configuration: Array) -> set[int]:
        """The islands of those corners of its grid cell to which a straight line is free."""
        low = [
            int(np.clip(np.searchsorted(a, v) - 1, 0, len(a) - 2))
            for a, v in zip(self._axes, configuration, strict=True)
        ]
        corners = [
            tuple(i + step for i, step in zip(low, steps, strict=True)) for steps in product((0, 1), repeat=len(low))
        ]
        return {
            int(self._islands[corner])
            for corner in corners
            if self._free[corner] and self._validity.is_line_free(configuration, self._rows[corner])
        }

    def _joined(self, axis: int) -> NDArray[np.bool_]:
        """True for each configuration that a free straight line joins to the next one along `axis`."""
        count = self._shape[axis]
        first, second = (np.take(self._free, range(*ends), axis) for ends in ((0, count - 1), (1, count)))
        joined = first & second
        for index in np.argwhere(joined):
            here = tuple(index)
            there = tuple(index + (np.arange(len(index)) == axis))
            joined[here] = self._validity.is_line_free(self._rows[here], self._rows[there])
        return np.asarray(joined)


def islands(free: NDArray[np.bool_], joined: list[NDArray[np.bool_]]) -> Indices:
    """A number for every configuration of the grid (n, n, ...), equal for those joined; NOWHERE for those not free.

    `free` and the result have the grid's shape; each of `joined` is one shorter along its own axis.
    """
    numbers = np.where(free, np.arange(free.size).reshape(free.shape), free.size)
    while True:
        before = numbers.copy()
        for axis, links in enumerate(joined):
            count = free.shape[axis]
            low = numbers[_part(free.ndim, axis, 0, count - 1)]
            high = numbers[_part(free.ndim, axis, 1, count)]
            least = np.minimum(low, high)
            np.copyto(low, least, where=links)
            np.copyto(high, least, where=links)
        numbers = np.where(free, numbers.reshape(-1)[np.minimum(numbers, free.size - 1)], free.size)
        if np.array_equal(numbers, before):
            return np.asarray(np.where(free, numbers, NOWHERE))


def _part(dimensions: int, axis: int, begin: int, end: int) -> tuple[slice, ...]:
    return tuple(slice(begin, end) if each == axis else slice(None) for each in range(dimensions))
