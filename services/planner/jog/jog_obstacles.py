"""Obstacles before a jogged arm, itself included, and the way out of a contact.

Few pairs of shapes have to be looked at again while the arm moves on: two that were seen so far apart stay apart until
the joints between them may have carried them that far.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.schemas.planning import JogLimit
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.braking import Braking
from gemelo.services.planner.jog.jog_limits import collision

Array = NDArray[np.float64]
Pairs = NDArray[np.int_]

# Tuning constants: chosen, where a line does not say measured or standard.
LEAST_LOOK = 0.001  # [m] that two shapes move against one another at most between two looks at their distance
SLACK = 0.0006  # [m] more than the clearance, for what happens between two looks
MOST_LOOKS = 24  # at distances for one velocity: a longer way along an obstacle has to be gone slower
LEVEL = 1e-7  # [m] that a depth may seem to grow between two looks where the motion is along the surface
CONTACT_SPEED = 0.02  # [m/s] of what is nearer than the clearance already, on its way out
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

    def pairs_along(self, margin: float, moved: Array) -> Pairs:
        """Which may be nearer than `margin` [m] somewhere on a path on which each pair moves by `moved` (pairs,) [m] at
        most; those that do not move are none of them."""
        counts = moved > STILL
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
