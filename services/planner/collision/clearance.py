"""The clearance that is kept, and walks along a path until something comes nearer (conservative advancement)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.robot import CLEARANCE, LEAST_CLEARANCE
from gemelo.services.planner.request.deadline import NEVER, Deadline

__all__ = ["CLEARANCE"]  # the default of what robots and requests may say

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
ROUNDING = 0.0002  # [m] more, for a configuration that is rounded before it is told
TOLD = 5e-5  # [m] that distances are told to at least; chosen: half of the last digit, 0.1 mm
MOST_LOOKS = 50_000  # chosen: bounds the time of one path where the margin is tiny


class DistanceChecker(Protocol):
    """Distances of the arm to itself, or to everything around it as well."""

    @property
    def clearance(self) -> float:
        """[m] that is to stay free between things that may not touch."""

    @property
    def reach(self) -> Array:
        """(n,) [m/rad] or [m/m] that any point of the arm moves at most per unit of each joint."""

    def distance(self, positions: Sequence[float] | Array) -> float:
        """Distance [m] of the nearest pair that is checked, at joint values (n,) [rad] or [m]."""

    def pairs_within(self, positions: Sequence[float] | Array, margin: float = 0.0) -> list[tuple[str, str]]:
        """Names of the pairs nearer than `margin` [m] at joint values (n,) [rad] or [m]."""


@runtime_checkable
class BoundingChecker(Protocol):
    """One that also knows quickly what a distance is at least."""

    def least_distance(self, positions: Sequence[float] | Array) -> float:
        """[m] that every pair is apart at least, at joint values (n,) [rad] or [m]; 0 where that is not known."""


class PathChecker(DistanceChecker, Protocol):
    """And of whole paths, pair by pair."""

    def touching(self, positions: Array, margin: float) -> Array | None:
        """A configuration (n,) [rad] or [m] on the polyline through `positions` (m, n) that does not keep `margin` [m],
        or None."""


def first_collision(
    checker: DistanceChecker, positions: Array, margin: float, deadline: Deadline = NEVER
) -> Array | None:
    """The first configuration along the rows of `positions` (m, n) that does not keep `margin` [m]; None where there is
    none, or none before the deadline."""
    return _walk(checker, positions, margin, deadline)[1]


def last_free(checker: DistanceChecker, start: Array, goal: Array, deadline: Deadline = NEVER) -> Array:
    """The last configuration (n,) [rad] or [m] on the straight line from `start` to `goal` before anything comes nearer
    than the clearance, as far as the deadline lets it be followed."""
    return _walk(checker, np.vstack((start, goal)), checker.clearance + ROUNDING, deadline)[0]


def usable_clearance(distance: float, margin: float) -> float | None:
    """The clearance [m], of whole tenths of a millimetre and below `margin`, that two things `distance` [m] apart would
    keep; None where that is less than any that may be asked for."""
    tenths = math.floor((distance - TOLD) * 1e4)
    usable = min(tenths * 1e-4, margin - 1e-4)
    return round(usable, 4) if usable >= LEAST_CLEARANCE - 1e-9 else None


def _walk(checker: DistanceChecker, positions: Array, margin: float, deadline: Deadline) -> tuple[Array, Array | None]:
    """The last configuration that keeps the margin, and the first one after it that does not.

    Between two looks no point of the arm moves farther than the clearance just seen, or than half the margin where
    there is none to spare, so that nothing is skipped (conservative advancement).
    """
    moved = _movement(checker, positions)
    end = float(moved[-1])
    least = max(0.5 * margin, end / MOST_LOOKS)
    along, last = 0.0, positions[0]
    quick = checker.least_distance if isinstance(checker, BoundingChecker) else _unknown
    while not deadline.has_passed():
        configuration = _configuration_at(along, moved, positions)
        clearance = quick(configuration) - margin
        if clearance <= least:
            clearance = checker.distance(configuration) - margin
        if clearance <= 0.0:
            return last, configuration
        if along >= end:
            return configuration, None
        last = configuration
        along = min(end, along + max(clearance, least))
    return last, None


def _unknown(configuration: Array) -> float:
    """[m] that every pair is apart at least, at joint values (n,) [rad] or [m], where that takes long to know."""
    return 0.0


def _movement(checker: DistanceChecker, positions: Array) -> Array:
    """(m,) [m] that any point of the arm has moved at most since the first row."""
    return np.concatenate(([0.0], np.cumsum(np.abs(np.diff(positions, axis=0)) @ checker.reach)))


def _configuration_at(along: float, moved: Array, positions: Array) -> Array:
    """The configuration (n,) after so much movement [m], on the line between two rows."""
    row = min(max(int(np.searchsorted(moved, along, side="right")) - 1, 0), len(moved) - 2) if len(moved) > 1 else 0
    if len(moved) == 1:
        return np.asarray(positions[0])
    step = float(moved[row + 1] - moved[row])
    share = min(1.0, (along - float(moved[row])) / step) if step > 0.0 else 1.0
    configuration: Array = positions[row] + share * (positions[row + 1] - positions[row])
    return configuration
