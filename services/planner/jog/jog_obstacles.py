"""Obstacles before a jogged arm, itself included, and the way out of a contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.planning import JogLimit
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.braking import Braking
from gemelo.services.planner.jog.jog_limits import collision
from gemelo.services.planner.jog.nearness import Nearness, Pairs

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
LEAST_LOOK = 0.001  # [m] that two shapes move against one another at most between two looks at their distance
SLACK = 0.0006  # [m] more than the clearance, for what happens between two looks
MOST_LOOKS = 24  # at distances for one velocity: a longer way along an obstacle has to be gone slower
LEVEL = 1e-7  # [m] that a depth may seem to grow between two looks where the motion is along the surface
CONTACT_SPEED = 0.02  # [m/s] of what is nearer than the clearance already, on its way out


class JogObstacles:
    """Of one world."""

    def __init__(self, world: World, braking: Braking) -> None:
        self._reach, self._clearance = world.reach, world.clearance
        self._nearness = Nearness(world)
        self._braking = braking
        self._here: Array = np.zeros(len(world.reach))

    def move_to(self, positions: Array) -> None:
        """Sets the arm's configuration (n,) [rad] or [m]."""
        self._here = positions
        self._nearness.move_to(positions)

    def most_out_of_contact(self, wanted: Array) -> tuple[float, JogLimit | None]:
        """The share of the velocity `wanted` (n,) [rad/s] or [m/s] at which no pair nearer than the clearance comes
        nearer, or leaves too fast."""
        pairs = self._nearness.pairs_within(self._clearance)
        if not pairs.size:
            return 1.0, None
        most = CONTACT_SPEED / max(CONTACT_SPEED, float(self._nearness.speeds(wanted, pairs).max()))
        return most, None if most == 1.0 else self._said(pairs, self._nearness.distances(pairs))

    def obstacle_ahead(self, velocity: Array) -> JogLimit | None:
        """The limit by what comes too near while the arm brakes from `velocity` (n,) [rad/s] or [m/s], or None.

        Conservative advancement, pair by pair; two that are nearer than they should be already may only come away.
        """
        displacement = self._braking.displacement_to_rest(velocity)
        floor = self._clearance + SLACK + self._straying(velocity)
        pairs = self._nearness.pairs_within(floor, displacement)
        before = self._nearness.distances(pairs)
        closing = self._hardly_known(displacement, pairs, before, floor)
        if closing is None:
            closing = self._closing(displacement, pairs, before, floor)
        if closing is None:
            closing = self._closing_before(displacement, pairs, before, floor)
        return None if closing is None else self._said(closing, self._nearness.distances(closing))

    def _hardly_known(self, displacement: Array, pairs: Pairs, before: Array, floor: float) -> Pairs | None:
        """The pairs that are clear now, dear to look at, and moved farther than one look on the way answers for."""
        free = np.maximum(before - floor, LEAST_LOOK)
        unseen = (
            self._nearness.are_dear(pairs) & (before >= floor) & (self._nearness.speeds(displacement, pairs) > free)
        )
        return pairs[unseen] if unseen.any() else None

    def _closing(self, displacement: Array, pairs: Pairs, before: Array, floor: float) -> Pairs | None:
        """The pairs that are too near at the end of the path, and not farther than before."""
        if not pairs.size:
            return None
        after = self._nearness.distances_at(self._here + displacement, pairs)
        too_near = (after < floor) & ~comes_away(before, after)
        return pairs[too_near] if too_near.any() else None

    def _closing_before(self, displacement: Array, pairs: Pairs, before: Array, floor: float) -> Pairs | None:
        """The same of any place before the end; pairs that are clear of one another for the rest fall out."""
        moved, along = self._nearness.speeds(displacement, pairs), 0.0
        for _ in range(MOST_LOOKS):
            free = np.maximum(before - floor, LEAST_LOOK)
            counts = (before < floor) | (free < (1.0 - along) * moved)
            pairs, before, moved, free = pairs[counts], before[counts], moved[counts], free[counts]
            if not pairs.size:
                return None
            along = min(1.0, along + float(np.min(free / moved)))
            after = self._nearness.distances_at(self._here + along * displacement, pairs)
            too_near = (after < floor) & ~comes_away(before, after)
            if too_near.any():
                return pairs[too_near]
            if along == 1.0:
                return None
            before = after
        return pairs

    def _straying(self, velocity: Array) -> float:
        """[m] by which joints that stop each on its own, when the targets cease, leave the straight path at most."""
        together, alone = np.abs(self._braking.together(velocity)), np.abs(self._braking.alone(velocity))
        whole = float(together @ self._reach)
        if whole == 0.0:
            return 0.0
        nearest = float(alone @ self._reach) / whole  # a place on the straight path that is near to where they stop
        return float(np.abs(alone - nearest * together) @ self._reach)

    def _said(self, pairs: Pairs, distances: Array) -> JogLimit:
        nearest = int(np.argmin(distances))
        return collision(self._nearness.names(int(pairs[nearest])), float(distances[nearest]), self._clearance)


def comes_away(before: Array | float, after: Array | float) -> NDArray[np.bool_]:
    """True if the distance `after` is above that `before`, both [m]; inside, motion along the surface counts too."""
    slack = np.where(np.less(before, 0.0), LEVEL, 0.0)
    return np.greater(after, np.subtract(before, slack))
