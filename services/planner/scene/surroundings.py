"""What a plan heeds: one world from its beginning to its end, however often the scene changes meanwhile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from schemas.scene import Contact
from services.arm.collisions import LinkPair
from services.planner.scene.world import World

Array = NDArray[np.float64]
Positions = Sequence[float] | Array


class Surroundings:
    """The world of the plan at hand for all that asks about distances; `newest` is the next plan's."""

    def __init__(self, world: World) -> None:
        self.newest = world
        self.world = world

    def begin(self) -> World:
        """From now on the newest world counts."""
        self.world = self.newest
        return self.world

    @property
    def reach(self) -> Array:
        return self.world.reach

    def distance(self, positions: Positions) -> float:
        """[m], as `World.distance`."""
        return self.world.distance(positions)

    def touching(self, positions: Array, margin: float) -> Array | None:
        """As `World.touching`."""
        return self.world.touching(positions, margin)

    def pairs_within(self, positions: Positions, margin: float = 0.0) -> list[LinkPair]:
        """As `World.pairs_within`."""
        return self.world.pairs_within(positions, margin)

    def contacts(self, positions: Positions, margin: float = 0.0) -> list[Contact]:
        """As `World.contacts`."""
        return self.world.contacts(positions, margin)
