"""Distances of all pairs of shapes while the arm moves on: few pairs have to be looked at again.

Two shapes that were seen so far apart stay apart until the joints between them may have carried them that far.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.services.planner.collision.world import World

Array = NDArray[np.float64]
Pairs = NDArray[np.int_]

# Tuning constants: chosen, where a line does not say measured or standard.
STILL = 1e-9  # [m] that two shapes move against one another: they do not


class Nearness:
    """Of one world, at one configuration (n,) [rad] or [m] after the other; pairs of shapes have numbers."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._reach: Array = world.pair_reach
        self._least: Array = np.empty(0)  # [m] that they are apart at least
        self._is_dear = world.is_dear
        self._is_exact = np.zeros(len(self._reach), dtype=bool)
        self._here: Array | None = None

    def move_to(self, configuration: Array) -> None:
        """Sets the configuration (n,) [rad] or [m] that the answers are about from now on."""
        if self._here is None:
            self._least = self._world.least_distances(configuration)
        else:
            self._least -= self._moved(configuration - self._here)
        self._is_exact[:] = False
        self._here = configuration

    def pairs_within(self, margin: float, displacement: Array | None = None) -> Pairs:
        """Which may be nearer than `margin` [m] here, or somewhere on a `displacement` (n,) from here that moves
        them."""
        moved = self._moved(displacement) if displacement is not None else np.zeros(len(self._reach))
        counts = moved > STILL if displacement is not None else np.ones(len(self._reach), dtype=bool)
        self._look_at(np.flatnonzero(counts & ~self._is_exact & (self._least - moved < margin)))
        return np.flatnonzero(counts & (self._least - moved < margin))

    def distances(self, pairs: Pairs) -> Array:
        """(k,) [m] here; exact for pairs that are not known to be farther."""
        return self._least[pairs]

    def are_dear(self, pairs: Pairs) -> NDArray[np.bool_]:
        """(k,) True for each pair of shapes whose distance takes too long to be computed often."""
        return self._is_dear[pairs]

    def distances_at(self, configuration: Array, pairs: Pairs) -> Array:
        """(k,) [m] somewhere else."""
        return self._world.distances(configuration, pairs.tolist())

    def speeds(self, velocity: Array, pairs: Pairs) -> Array:
        """(k,) [m/s] at which the shapes move against one another at most."""
        speeds: Array = self._reach[pairs] @ np.abs(velocity)
        return speeds

    def names(self, pair: int) -> LinkPair:
        """Names of the two links or objects of a pair."""
        return self._world.pair_names[pair]

    def _moved(self, displacement: Array) -> Array:
        moved: Array = self._reach @ np.abs(displacement)
        return moved

    def _look_at(self, pairs: Pairs) -> None:
        if pairs.size:
            assert self._here is not None
            self._least[pairs] = self._world.distances(self._here, pairs.tolist())
            self._is_exact[pairs] = True
