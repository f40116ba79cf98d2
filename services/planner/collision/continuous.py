"""A whole path against all that may touch: every pair of shapes is looked at only as often as it comes near.

Two shapes that are so far apart stay apart for as long as the joints between them do not carry them farther than that:
a look answers for a stretch of the path on both sides, a long one for most pairs (conservative advancement, pair by
pair; Mirtich 1996). Joints that carry both shapes of a pair do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.request.deadline import NEVER, Deadline

Array = NDArray[np.float64]
Look = Callable[[Array, Sequence[int]], Array]

# Tuning constants: chosen, where a line does not say measured or standard.
FINEST = 0.25  # of the margin: so far at least does a look answer, whatever it sees
MOST_LOOKS = 50_000  # chosen: bounds the time of one path where the margin is tiny


class _Part(NamedTuple):
    """From one fractional row number to another, and how far [m] a pair has moved at most by then."""

    low: float
    high: float
    left: float
    right: float


class ContinuousCheck:
    """For one world; `look(configuration, pairs)` says how far apart [m] these pairs are, of which `reach` (k, n) says
    how far at most [m] they move against one another per unit of each joint."""

    def __init__(self, reach: Array, look: Look) -> None:
        self.reach, self._look = reach, look

    def touching(
        self,
        positions: Array,
        margin: float,
        deadline: Deadline = NEVER,
        asked: NDArray[np.int_] | None = None,
    ) -> Array | None:
        """Any configuration along the rows of `positions` (m, n) at which a pair is nearer than `margin` [m], or None;
        of the `asked` (k,) pairs alone where these are given. Raises `PlanRefused` once the deadline has passed."""
        among = np.arange(len(self.reach)) if asked is None else asked
        moved = self._movement(positions, among)
        finest = max(FINEST * margin, float(moved[-1].max(initial=0.0)) / MOST_LOOKS)
        waiting = [(0.0, float(len(positions) - 1), np.arange(len(among)), moved[0], moved[-1])]
        while waiting:
            deadline.check()
            low, high, pairs, left, right = waiting.pop()
            if len(pairs) == 1:
                part = _Part(low, high, float(left[0]), float(right[0]))
                of_one = moved[:, pairs[0]].tolist()
                touching = self._touching_one(int(among[pairs[0]]), part, positions, of_one, margin, finest, deadline)
                if touching is not None:
                    return touching
                continue
            middle = 0.5 * (low + high)
            configuration = _at(middle, positions)
            spare = self._look(configuration, among[pairs].tolist()) - margin
            if spare.size and float(spare.min()) <= 0.0:
                return configuration
            reached, known = _at(middle, moved)[pairs], np.maximum(spare, finest)
            before, after = reached - left > known, right - reached > known
            if before.any():
                waiting.append((low, middle, pairs[before], left[before], reached[before]))
            if after.any():
                waiting.append((middle, high, pairs[after], reached[after], right[after]))
        return None

    def _touching_one(
        self, pair: int, part: _Part, positions: Array, moved: list[float], margin: float, finest: float,
        deadline: Deadline,
    ) -> Array | None:  # fmt: skip
        """As `touching`, of one pair that has `moved` (m,) [m] by each row: without arrays, in half the time."""
        waiting = [part]
        while waiting:
            deadline.check()
            low, high, left, right = waiting.pop()
            middle = 0.5 * (low + high)
            configuration = _at(middle, positions)
            spare = float(self._look(configuration, (pair,))[0]) - margin
            if spare <= 0.0:
                return configuration
            row = min(int(middle), len(moved) - 1)
            share = middle - row
            reached = moved[row] if share == 0.0 else (1.0 - share) * moved[row] + share * moved[row + 1]
            known = max(spare, finest)
            if reached - left > known:
                waiting.append(_Part(low, middle, left, reached))
            if right - reached > known:
                waiting.append(_Part(middle, high, reached, right))
        return None

    def _movement(self, positions: Array, among: NDArray[np.int_]) -> Array:
        """(m, k) [m] that each of these (k,) pairs has moved at most since the first row."""
        steps = np.abs(np.diff(positions, axis=0)) @ self.reach[among].T
        return np.concatenate((np.zeros((1, len(among))), np.cumsum(steps, axis=0)))


def _at(place: float, rows: Array) -> Array:
    """The row at a fractional place, on the line between two."""
    first = min(int(place), len(rows) - 1)
    share = place - first
    return np.asarray(rows[first] if share == 0.0 else (1.0 - share) * rows[first] + share * rows[first + 1])
