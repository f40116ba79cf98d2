"""How near links may come, and how far along a way the arm can go before they do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.arm.collisions import SelfCollisions

Array = NDArray[np.float64]

CLEARANCE = 0.004  # [m] that links which may not touch keep between them
ROUNDING = 0.0002  # [m] more, for a posture that is rounded before it is told
MOST_LOOKS = 50_000


def first_collision(collisions: SelfCollisions, positions: Array, margin: float) -> Array | None:
    """The first posture along the rows of `positions` (m, n) whose links are nearer than `margin` [m], or None."""
    return _walk(collisions, positions, margin)[1]


def last_free(collisions: SelfCollisions, start: Array, goal: Array) -> Array:
    """The last posture (n,) on the straight line from `start` to `goal` before links come nearer than the clearance."""
    return _walk(collisions, np.vstack((start, goal)), CLEARANCE + ROUNDING)[0]


def _walk(collisions: SelfCollisions, positions: Array, margin: float) -> tuple[Array, Array | None]:
    """The last posture that keeps the margin, and the first one after it that does not.

    Between two looks no point of the arm moves farther than the clearance just seen, or than half the margin where
    there is none to spare, so that nothing is skipped (conservative advancement).
    """
    moved = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(positions, axis=0)) @ collisions.reach)))  # [m] at most
    end = float(moved[-1])
    least = max(0.5 * margin, end / MOST_LOOKS)
    along, last = 0.0, positions[0]
    while True:
        posture = np.array([np.interp(along, moved, column) for column in positions.T])
        clearance = collisions.distance(posture) - margin
        if clearance <= 0.0:
            return last, posture
        if along >= end:
            return posture, None
        last = posture
        along = min(end, along + max(clearance, least))
