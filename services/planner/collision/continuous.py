"""A whole path against all that may touch: every pair of shapes is looked at only as often as it comes near.

Two shapes that are so far apart stay apart for as long as the joints between them do not carry them farther than that:
a look answers for a stretch of the path on both sides, a long one for most pairs (conservative advancement, pair by
pair; Mirtich 1996). Joints that carry both shapes of a pair do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from services.arm.kinematics.kinematics import Kinematics
from services.arm.kinematics.self_collisions import driver_of, shape_reach
from services.arm.model.description import Arm
from services.planner.collision.world_geometry import WorldGeometry

Array = NDArray[np.float64]
Look = Callable[[Array, Sequence[int]], Array]

# Tuning constants: chosen, where a line does not say measured or standard.
FINEST = 0.25  # of the margin: so far at least does a look answer, whatever it sees
MOST_LOOKS = 50_000


class ContinuousCheck:
    """For one world; `look(configuration, pairs)` says how far apart [m] these pairs are."""

    def __init__(self, arm: Arm, kinematics: Kinematics, geometry: WorldGeometry, look: Look) -> None:
        self._look = look
        self.reach: Array = _pair_reach(arm, kinematics.model, geometry)

    def touching(self, positions: Array, margin: float) -> Array | None:
        """Any configuration along the rows of `positions` (m, n) at which a pair is nearer than `margin` [m], or
        None."""
        moved = self._movement(positions)
        finest = max(FINEST * margin, float(moved[-1].max(initial=0.0)) / MOST_LOOKS)
        waiting = [(0.0, float(len(positions) - 1), np.arange(len(self.reach)), moved[0], moved[-1])]
        while waiting:
            low, high, pairs, left, right = waiting.pop()
            middle = 0.5 * (low + high)
            configuration = _at(middle, positions)
            spare = self._look(configuration, pairs.tolist()) - margin
            if spare.size and float(spare.min()) <= 0.0:
                return configuration
            reached, known = _at(middle, moved)[pairs], np.maximum(spare, finest)
            before, after = reached - left > known, right - reached > known
            if before.any():
                waiting.append((low, middle, pairs[before], left[before], reached[before]))
            if after.any():
                waiting.append((middle, high, pairs[after], reached[after], right[after]))
        return None

    def _movement(self, positions: Array) -> Array:
        """(m, k) [m] that each pair has moved at most since the first row."""
        steps = np.abs(np.diff(positions, axis=0)) @ self.reach.T
        return np.concatenate((np.zeros((1, len(self.reach))), np.cumsum(steps, axis=0)))


def _at(place: float, rows: Array) -> Array:
    """The row at a fractional place, on the line between two."""
    first = min(int(place), len(rows) - 1)
    share = place - first
    return np.asarray(rows[first] if share == 0.0 else (1.0 - share) * rows[first] + share * rows[first + 1])


def _pair_reach(arm: Arm, model: pin.Model, geometry: WorldGeometry) -> Array:
    """(k, n) how far at most [m] the two shapes of each pair move against one another per unit of each joint."""
    shapes = geometry.model.geometryObjects
    carriers = [{joint for joint in model.supports[shape.parentJoint] if joint > 0} for shape in shapes]
    reach = np.zeros((len(geometry.pairs), len(arm.joints)))
    for row, (one, other) in enumerate(geometry.pairs):
        for joint in carriers[one] ^ carriers[other]:
            moved = shapes[one if joint in carriers[one] else other]
            source, scale = driver_of(arm, model, joint)
            reach[row, source] += scale * shape_reach(arm, model, moved, joint)
    return reach
