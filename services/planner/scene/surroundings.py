"""What a plan heeds: one world from its beginning to its end, however often the scene changes meanwhile.

The compiled core is asked first: what its spheres let be is free on the exact shapes too. Coal decides about the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.scene import Contact
from services.arm.collisions import LinkPair
from services.planner.scene.world import World
from services.planner.search.native_scene import native_scene
from services.planner.search.native_search import native_core, show_scene

if TYPE_CHECKING:
    from services.planner.native import MotionCore

Array = NDArray[np.float64]
Positions = Sequence[float] | Array


class Surroundings:
    """The world of the plan at hand for all that asks about distances; `newest` is the next plan's."""

    def __init__(self, world: World) -> None:
        self.newest = world
        self.world = world
        self._shown: World | None = None

    def begin(self) -> World:
        """From now on the newest world counts."""
        self.world = self.newest
        return self.world

    def core(self, margin: float) -> MotionCore | None:
        """The compiled core in this world, to keep `margin` [m]; None where it is not built."""
        core = self._core
        if core is not None:
            if self._shown is not self.world:
                show_scene(core, *native_scene(self.world.arm, self.world.scene, self.world.folders))
                self._shown = self.world
            core.margin = margin
        return core

    @cached_property
    def _core(self) -> MotionCore | None:
        """Takes a second, the first time: the links are filled with spheres."""
        return native_core(self.world.arm)

    @property
    def reach(self) -> Array:
        return self.world.reach

    def keeps(self, positions: Positions, margin: float) -> bool:
        """Whether everything is farther than `margin` [m]."""
        core = self.core(margin)
        if core is not None and core.free(np.array([positions]))[0]:
            return True
        return self.world.distance(positions) > margin

    def distance(self, positions: Positions) -> float:
        """[m], as `World.distance`."""
        return self.world.distance(positions)

    def touching(self, positions: Array, margin: float) -> Array | None:
        """As `World.touching`."""
        core = self.core(margin)
        if core is None or len(positions) < 2:
            return self.world.touching(positions, margin)
        if core.way_free(positions):
            return None
        surely = core.touching(positions)
        return self._touching_in_doubt(positions, core.doubts(positions), margin) if surely is None else surely

    def pairs_within(self, positions: Positions, margin: float = 0.0) -> list[LinkPair]:
        """As `World.pairs_within`."""
        return self.world.pairs_within(positions, margin)

    def contacts(self, positions: Positions, margin: float = 0.0) -> list[Contact]:
        """As `World.contacts`."""
        return self.world.contacts(positions, margin)

    def _touching_in_doubt(self, rows: Array, doubts: Array, margin: float) -> Array | None:
        """By coal, within `doubts` (k, 2) of the polyline through `rows` (m, n)."""
        for begin, end in doubts.tolist():
            posture = self.world.touching(rows_between(rows, begin, end), margin)
            if posture is not None:
                return posture
        return None


def rows_between(rows: Array, begin: float, end: float) -> Array:
    """The part of the polyline through `rows` (m, n) from one place to another, both in rows."""
    begin, end = max(begin, 0.0), min(end, len(rows) - 1.0)
    ends = [(1.0 - place % 1.0) * rows[int(place)] + place % 1.0 * rows[math.ceil(place)] for place in (begin, end)]
    return np.vstack((ends[0], rows[int(begin) + 1 : math.ceil(end)], ends[1]))
