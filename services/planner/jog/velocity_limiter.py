"""The largest share of a velocity from which the arm can stop: before limits, singularities and obstacles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planning import JogLimit
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.braking import Braking
from gemelo.services.planner.jog.jog_limits import joint_limit
from gemelo.services.planner.jog.jog_obstacles import JogObstacles

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
LIMIT_SHARES, LIMIT_ROUNDS = 25, 3  # that are tried at once, and how often more finely
SINGULARITY_HALVINGS = 6  # chosen: finds the share to 1/64, finer than a person feels
FACTORS = (1.2, 0.9, 0.5)  # of the share of the tick before, where something is in the way
LEAST_SHARE = 0.01  # chosen: from a stop the search begins here, as 0 has no larger multiple

# What is too near on a path (n,) [rad] or [m] from where the arm is; None where it may be gone.
Singular = Callable[[Array], JogLimit | None]


@dataclass(frozen=True)
class Allowed:
    """The next velocity (n,) [rad/s] or [m/s], the share of the wanted one that it heads for, and what limits it."""

    velocity: Array
    share: float = 1.0
    limits: tuple[JogLimit, ...] = ()


class VelocityLimiter:
    """Finds the largest share of a velocity from which the arm can still stop.

    Braking at any tick stays on the way that was found free at the tick before, so it is always possible.
    """

    def __init__(self, arm: ArmDescription, world: World, braking: Braking) -> None:
        self._joints, self._braking = arm.joints, braking
        self._obstacles = JogObstacles(world, braking)
        self._share = 1.0  # of the wanted velocity that was free the last time something was in the way

    def allowed(self, positions: Array, velocity: Array, wanted: Array, singular: Singular | None = None) -> Allowed:
        """The velocity (n,) [rad/s] or [m/s] of the next tick between `velocity` and `wanted`, (n,), from which the arm
        at `positions` (n,) [rad] or [m] can still stop."""
        if not np.any(wanted):
            return Allowed(self._next(velocity, wanted, 0.0))
        share, limit = self._within_limits(positions, velocity, wanted)
        if singular is not None and (found := singular(self._displacement(velocity, wanted, share))) is not None:
            limit = found
            share = _largest(
                lambda part: singular(self._displacement(velocity, wanted, part)) is None, share, SINGULARITY_HALVINGS
            )
        return self._free(positions, velocity, wanted, share, limit)

    def _next(self, velocity: Array, wanted: Array, share: float) -> Array:
        return self._braking.towards(velocity, share * wanted)

    def _displacement(self, velocity: Array, wanted: Array, share: float) -> Array:
        return self._braking.displacement_to_rest(self._next(velocity, wanted, share))

    def _within_limits(self, positions: Array, velocity: Array, wanted: Array) -> tuple[float, JogLimit | None]:
        outside = self._beyond(positions, velocity, wanted)
        if np.all(outside <= 0.0):
            return 1.0, None
        worst = int(np.argmax(outside))
        limit = joint_limit(self._joints[worst], float(positions[worst]), float(wanted[worst] or velocity[worst]))
        least, width = 0.0, 1.0  # 0, which is braking, always is allowed
        for _ in range(LIMIT_ROUNDS):
            shares = least + width * np.arange(1, LIMIT_SHARES) / LIMIT_SHARES
            allowed = np.all(self._beyond(positions, velocity, shares[:, None] * wanted) <= 0.0, axis=1)
            width /= LIMIT_SHARES
            least += width * (len(shares) if allowed.all() else int(np.argmin(allowed)))
        return least, limit

    def _beyond(self, positions: Array, velocity: Array, wanted: Array) -> Array:
        """[rad] or [m] by which each joint would come to rest outside its limits, a row for each of `wanted`."""
        end = positions + self._braking.displacement_to_rest(self._braking.towards(velocity, wanted))
        lower, upper = np.minimum(self._braking.lower, positions), np.maximum(self._braking.upper, positions)
        outside: Array = np.maximum(lower - end, end - upper) - 1e-12
        return outside

    def _free(self, positions: Array, velocity: Array, wanted: Array, most: float, limit: JogLimit | None) -> Allowed:
        self._obstacles.move_to(positions)
        out, contact = self._obstacles.most_out_of_contact(wanted)
        most = min(most, out)
        candidate = self._next(velocity, wanted, most)
        obstacle = self._obstacles.obstacle_ahead(candidate)
        self._share = most if obstacle is None else self._near_the_last(velocity, wanted, most)
        limits = tuple(found for found in (limit, obstacle or contact) if found is not None)
        if obstacle is None:
            return Allowed(candidate, most, limits)
        return Allowed(self._next(velocity, wanted, self._share), self._share, limits)

    def _near_the_last(self, velocity: Array, wanted: Array, most: float) -> float:
        """A share that is free, not far from the one before: distances are dear."""
        for factor in FACTORS:
            share = min(factor * max(self._share, LEAST_SHARE), most)
            if self._obstacles.obstacle_ahead(self._next(velocity, wanted, share)) is None:
                return share
        return 0.0


def _largest(is_allowed: Callable[[float], bool], most: float, halvings: int) -> float:
    """The largest share up to `most`, which is not allowed itself; 0, which is braking, always is."""
    low, high = 0.0, most
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_allowed(middle) else (low, middle)
    return low
