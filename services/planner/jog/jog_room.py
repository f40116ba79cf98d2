"""How much of a wanted velocity leaves room to stop: before joint limits, singularities and what the arm may touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm
from services.planner.jog.braking import Braking
from services.planner.scene.clearance import CLEARANCE
from services.planner.scene.world import World

Array = NDArray[np.float64]

LEAST_LOOK = 0.001  # [m] that any point of the arm moves at most between two looks at distances
SLACK = 0.0006  # [m] more than the clearance, for what happens between two looks
MOST_LOOKS = 8  # at distances for one velocity: a longer way along an obstacle has to be gone slower
LIMIT_HALVINGS, SINGULARITY_HALVINGS = 14, 6
FACTORS = (1.2, 0.9, 0.5)  # of the share of the tick before, where something is in the way
LEAST_SHARE = 0.01

IsFree = Callable[[Array], bool]  # whether a way (n,) [rad] or [m] from where the arm is may be gone


@dataclass(frozen=True)
class Allowed:
    """The next velocity (n,) [rad/s] or [m/s], the share of the wanted one that it heads for, and what limits it."""

    velocity: Array
    share: float = 1.0
    limited_by: str = ""
    touching: Array | None = None  # the posture that was too near something


class Room:
    """Finds the largest share of a velocity from which the arm can still stop.

    Braking at any tick stays on the way that was found free at the tick before, so it is always possible.
    """

    def __init__(self, arm: Arm, world: World, braking: Braking) -> None:
        self._names = arm.joint_names
        self._world, self._braking = world, braking
        self._share = 1.0  # of the wanted velocity that was free the last time something was in the way

    @property
    def world(self) -> World:
        return self._world

    def allowed(self, positions: Array, velocity: Array, wanted: Array, is_regular: IsFree | None = None) -> Allowed:
        """The velocity of the next tick on the way from `velocity` to `wanted`; ways must also be `is_regular`."""
        if not np.any(wanted):
            return Allowed(self._next(velocity, wanted, 0.0))
        share, limited_by = self._within_limits(positions, velocity, wanted)
        if is_regular is not None and not is_regular(self._way(self._next(velocity, wanted, share))):
            limited_by = "singularity"
            share = _largest(
                lambda part: is_regular(self._way(self._next(velocity, wanted, part))), share, SINGULARITY_HALVINGS
            )
        return self._free(positions, velocity, wanted, share, limited_by)

    def names_at(self, posture: Array) -> str:
        """What is nearest at a posture."""
        margin = self._world.distance(posture) + 1e-6
        pairs = self._world.pairs_within(posture, margin)
        return "collision of " + " and ".join(pairs[0]) if pairs else "collision"

    def _next(self, velocity: Array, wanted: Array, share: float) -> Array:
        return self._braking.towards(velocity, share * wanted)

    def _way(self, velocity: Array) -> Array:
        """(n,) [rad] or [m] to rest, with the tick that is about to come."""
        return self._braking.dt * velocity + self._braking.together(velocity)

    def _within_limits(self, positions: Array, velocity: Array, wanted: Array) -> tuple[float, str]:
        lower = np.minimum(self._braking.lower, positions) - 1e-12
        upper = np.maximum(self._braking.upper, positions) + 1e-12

        def beyond(share: float) -> Array:
            end = positions + self._way(self._next(velocity, wanted, share))
            outside: Array = np.maximum(lower - end, end - upper)
            return outside

        outside = beyond(1.0)
        if np.all(outside <= 0.0):
            return 1.0, ""
        share = _largest(lambda part: bool(np.all(beyond(part) <= 0.0)), 1.0, LIMIT_HALVINGS)
        return share, f"joint limit of {self._names[int(np.argmax(outside))]}"

    def _free(self, positions: Array, velocity: Array, wanted: Array, most: float, limited_by: str) -> Allowed:
        here = self._world.distance(positions)
        candidate = self._next(velocity, wanted, most)
        touching = self._touching(positions, candidate, here)
        if touching is None:
            self._share = most
            return Allowed(candidate, most, limited_by)
        self._share = self._near_the_last(
            lambda part: self._touching(positions, self._next(velocity, wanted, part), here) is None, most
        )
        return Allowed(self._next(velocity, wanted, self._share), self._share, limited_by, touching)

    def _near_the_last(self, is_free: Callable[[float], bool], most: float) -> float:
        """A share that is free, not far from the one before: distances are dear."""
        for factor in FACTORS:
            share = min(factor * max(self._share, LEAST_SHARE), most)
            if is_free(share):
                return share
        return 0.0

    def _touching(self, positions: Array, velocity: Array, here: float) -> Array | None:
        """The first posture on the way to rest that is too near something, or None; `here` [m] is the distance now.

        Conservative advancement; what is nearer than it should be already may only come away.
        """
        way = self._way(velocity)
        reach = self._world.reach
        length = float(np.abs(way) @ reach)  # [m] that any point moves at most
        floor = CLEARANCE + SLACK + self._straying(velocity)
        end = positions + way
        last = self._world.distance(end) if here - floor < length else floor
        if last < floor and last <= here:
            return end
        along, before = 0.0, here
        for _ in range(MOST_LOOKS):
            along += max(before - floor, LEAST_LOOK)
            if along >= length and before >= floor:
                return None
            posture = positions + min(1.0, along / length) * way if length > 0.0 else positions
            distance = self._world.distance(posture)
            if distance < floor and distance <= before:
                return posture
            if along >= length:
                return None
            before = distance
        return posture

    def _straying(self, velocity: Array) -> float:
        """[m] by which joints that stop each on its own, when the targets cease, leave the straight way at most."""
        together, alone = np.abs(self._braking.together(velocity)), np.abs(self._braking.alone(velocity))
        reach = self._world.reach
        whole = float(together @ reach)
        if whole == 0.0:
            return 0.0
        nearest = float(alone @ reach) / whole  # a place on the straight way that is near to where they stop
        return float(np.abs(alone - nearest * together) @ reach)


def _largest(is_allowed: Callable[[float], bool], most: float, halvings: int) -> float:
    """The largest share up to `most`, which is not allowed itself; 0, which is braking, always is."""
    low, high = 0.0, most
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_allowed(middle) else (low, middle)
    return low
