"""Collision checks of one plan: one world from its beginning to its end, however often the scene changes meanwhile.

The native planner's spheres are asked first: what they call free or touching is so on the exact shapes too. Coal
decides what they leave open, and everything where the native planner is not built.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.schemas.scene import Contact
from gemelo.services.planner.collision.sphere_check import native_planner, rows_between, show_scene
from gemelo.services.planner.collision.world import Positions, World
from gemelo.services.planner.request.deadline import NEVER

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]


class CollisionChecker:
    """Distances and contacts in `world`, the one of the plan at hand; `newest` is the next plan's.

    Joint values are (n,) or rows (m, n) [rad] or [m] in the arm's order; distances and margins are in m.
    """

    def __init__(self, world: World) -> None:
        self.newest = world
        self.world = world
        self.clearance = world.clearance  # [m] of the plan at hand
        self.deadline = NEVER  # after which no question of the plan at hand is answered, but by `PlanRefused`
        self._shown: World | None = None  # by the native planner

    def begin(self) -> World:
        """Makes the newest world the one that counts, and returns it."""
        self.world.deadline = NEVER
        self.world = self.newest
        self.world.deadline = self.deadline
        return self.world

    def native(self, margin: float) -> NativePlanner | None:
        """The native planner in this world, to keep `margin` [m]; None if it is not built."""
        planner = self._planner
        if planner is not None:
            if self._shown is not self.world:
                show_scene(planner, self.world)
                self._shown = self.world
            planner.margin = margin
        return planner

    @cached_property
    def _planner(self) -> NativePlanner | None:
        return native_planner(self.world.arm)

    @property
    def reach(self) -> Array:
        """(n,) [m/rad] or [m/m] that any point of the arm moves at most per unit of each joint."""
        return self.world.reach

    def keeps(self, positions: Positions, margin: float) -> bool:
        """True if everything is farther than `margin` [m] in this configuration (n,)."""
        self.deadline.check()
        native = self.native(margin)
        if native is not None and native.is_free(positions):
            return True
        return self._touching(np.array((positions, positions)), margin) is None

    def distance(self, positions: Positions) -> float:
        """Distance [m] of the nearest pair, as `World.distance`."""
        self.deadline.check()
        return self.world.distance(positions)

    def least_distance(self, positions: Positions) -> float:
        """[m] that every pair is apart at least, by the spheres alone; 0 where they touch or nothing is known."""
        native = self._planner if self._shown is self.world else self.native(self.world.clearance)
        return 0.0 if native is None else native.distance(positions)

    def touching(self, positions: Array, margin: float) -> Array | None:
        """A configuration (n,) on the polyline through `positions` (m, n) nearer than `margin` [m], or None."""
        self.deadline.check()
        if len(positions) < 2:
            return self.world.touching(positions, margin)
        native = self.native(margin)
        if native is not None and native.path_free(positions):
            return None
        return self._touching(positions, margin)

    def _touching(self, positions: Array, margin: float) -> Array | None:
        """As `touching`, where the spheres do not know it to be free."""
        native = self.native(margin)
        if native is None:
            return self.world.touching(positions, margin)
        touching = native.touching(positions)
        if touching is not None:
            return touching
        for each in native.unresolved_intervals(positions):
            touching = self.world.touching(rows_between(positions, each.begin, each.end), margin, each.pairs)
            if touching is not None:
                return touching
        return None

    def pairs_within(self, positions: Positions, margin: float = 0.0) -> list[LinkPair]:
        """Names of the pairs nearer than `margin` [m], as `World.pairs_within`."""
        return self.world.pairs_within(positions, margin)

    def contacts(self, positions: Positions, margin: float = 0.0) -> list[Contact]:
        """The pairs nearer than `margin` [m] with distance and point, as `World.contacts`."""
        self.deadline.check()
        return self.world.contacts(positions, margin)
