"""Obstacles on a short path of the arm, itself included: conservative advancement along its rows, pair by pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.planning import JogLimit
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.jog_limits import collision
from gemelo.services.planner.jog.jog_obstacles import LEAST_LOOK, SLACK, Nearness, Pairs, comes_away

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_LOOKS = 60  # at distances, for one path: a longer way along an obstacle has to be gone in shorter ones


class PathWatch:
    """Of one world, asked about one path after the other; few pairs have to be looked at again."""

    def __init__(self, world: World) -> None:
        self._reach, self._clearance = world.pair_reach, world.clearance
        self._nearness = Nearness(world)

    def in_the_way(self, rows: Array, margin: float = 0.0) -> JogLimit | None:
        """The limit by what comes nearer than `margin` [m] on the path through `rows` (m, n) [rad] or [m], or None; 0:
        than the robot's clearance. What is nearer already at its beginning may only come away."""
        margin = margin or self._clearance
        floor = margin + SLACK
        self._nearness.move_to(rows[0])
        steps = np.abs(np.diff(rows, axis=0)) @ self._reach.T
        moved = np.vstack((np.zeros(len(self._reach)), np.cumsum(steps, axis=0)))
        pairs = self._nearness.pairs_along(floor, moved[-1])
        before = self._nearness.distances(pairs)
        unseen = self._nearness.are_dear(pairs) & (before >= floor) & (before - floor < moved[-1, pairs])
        closing = pairs[unseen] if unseen.any() else self._closing(rows, moved, pairs, before, floor)
        if closing is None:
            return None
        distances = self._nearness.distances(closing)
        nearest = int(np.argmin(distances))
        return collision(self._nearness.names(int(closing[nearest])), float(distances[nearest]), margin)

    def _closing(self, rows: Array, moved: Array, pairs: Pairs, before: Array, floor: float) -> Pairs | None:
        """The pairs that come too near, or that were too near before and come no farther; None where none does.

        `moved` (m, all pairs) [m] says how far each has moved at most until a row.
        """
        places, along = np.arange(len(rows), dtype=float), 0.0
        gone = np.zeros(len(pairs))
        for _ in range(MOST_LOOKS):
            free = np.maximum(before - floor, LEAST_LOOK)
            counts = (moved[-1, pairs] > gone) & ((before < floor) | (free < moved[-1, pairs] - gone))
            pairs, before, gone, free = pairs[counts], before[counts], gone[counts], free[counts]
            if not pairs.size:
                return None
            reached = [np.interp(g + f, moved[:, pair], places) for g, f, pair in zip(gone, free, pairs, strict=True)]
            along = min(max(along + 1e-6, float(min(reached))), places[-1])
            after = self._nearness.distances_at(_at(rows, along), pairs)
            too_near = (after < floor) & ~comes_away(before, after)
            if too_near.any():
                return pairs[too_near]
            if along == places[-1]:
                return None
            before, gone = after, _at(moved[:, pairs], along)
        return pairs


def _at(rows: Array, along: float) -> Array:
    """The row at a fractional place."""
    first = min(int(along), len(rows) - 2)
    between: Array = rows[first] + (along - first) * (rows[first + 1] - rows[first])
    return between
