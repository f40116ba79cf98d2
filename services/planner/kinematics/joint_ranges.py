"""Joint values within the limits: full turns of a closed-form solution, and starts spread over the joint ranges."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.services.planner.native.compiled import motion, where_built

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
NEVER = 1e9  # [m] after which a slide would be where it was
MOST_TURNS = 64  # combinations of full turns of one branch; chosen: bounds the time where several joints turn often
ROUNDING = 1e-9  # [rad] or [m] by which a solution may be beyond a limit before it is put onto it


class FullTurns:
    """For one arm; joint values are (n,) [rad] or [m] in the arm's order."""

    def __init__(self, arm: ArmDescription) -> None:
        self._lower = np.array([joint.lower - ROUNDING for joint in arm.joints])
        self._upper = np.array([joint.upper + ROUNDING for joint in arm.joints])
        self._speed = np.array([joint.velocity for joint in arm.joints])
        self._period = np.array([math.tau if joint.unit == "rad" else NEVER for joint in arm.joints])
        self._is_limited = bool(np.isfinite((self._lower, self._upper)).all())
        self.has_endless = bool(np.isinf(self._upper).any())  # a joint without limits

    def within_limits(self, branches: Array, near: Array) -> Array:
        """The branches (m, n) or one of them (n,), [rad] or [m], with every full turn within the limits, (k, n); joints
        without limits as near to `near` (n,) as they can be."""
        branches = np.atleast_2d(branches)
        lower, upper = self._lower, self._upper
        if not self._is_limited:
            lower = np.where(np.isinf(lower), near - 0.5 * self._period, lower)
            upper = np.where(np.isinf(upper), near + 0.5 * self._period, upper)
        return turned(branches, lower, upper, self._period)

    def other_ways_round(self, values: Array, near: Array, most: int) -> list[Array]:
        """`values` (n,) [rad] or [m] with a full turn more or less of one or more joints without limits, where the arm
        stands as it does at `values`: at most `most`, the fastest to reach from `near` (n,) first."""
        choices = [(-1, 0, 1) if endless else (0,) for endless in np.isinf(self._upper).tolist()]
        turns = np.array([each for each in product(*choices) if any(each)], dtype=float).reshape(-1, len(values))
        return list(nearest_first(values + math.tau * turns, near, self._speed)[:most])

    def nearly(self, branches: Array) -> tuple[Array, Array]:
        """The branches (m, n) [rad] or [m] with the full turns that bring them nearest to the limits, and (m,) [rad] or
        [m] by how much the worst joint of each exceeds its limits."""
        middle, half = 0.5 * (self._lower + self._upper), 0.5 * (self._upper - self._lower)
        middle = np.where(np.isfinite(middle), middle, 0.0)
        away = branches - middle
        away = away - self._period * np.rint(away / self._period)
        return middle + away, np.maximum(np.abs(away) - half, 0.0).max(axis=1)


def turned_in_python(branches: Array, lower: Array, upper: Array, period: Array) -> Array:
    """`turned` of `branches` (m, n) from `lower` to `upper` with `period` (n,), [rad] or [m], where the core is not
    built."""
    first = branches + period * np.ceil((lower - branches) / period)
    more = np.floor((upper - first) / period)
    fits = (more >= 0.0).all(axis=1)  # false for what is not a number, too
    configurations = [
        values + _turns(tuple(turns)) for values, turns in zip(first[fits], more[fits].tolist(), strict=True)
    ]
    return np.concatenate(configurations) if configurations else first[:0]


@where_built(turned_in_python)
def turned(branches: Array, lower: Array, upper: Array, period: Array) -> Array:
    """The `branches` (m, n) with every full turn from `lower` to `upper` (n,), all [rad] or [m], (k, n); after its
    `period` (n,) a joint stands as before."""
    return motion.turned(np.ascontiguousarray(branches), lower, upper, period, math.tau, MOST_TURNS)


def nearest_first_in_python(rows: Array, near: Array, speed: Array) -> Array:
    """`nearest_first` of `rows` (m, n) from `near` (n,) at `speed` (n,), where the core is not built."""
    travels = np.abs(rows - near) / speed
    return np.asarray(rows[np.argsort(travels.max(axis=1), kind="stable")])


@where_built(nearest_first_in_python)
def nearest_first(rows: Array, near: Array, speed: Array) -> Array:
    """The `rows` (m, n) [rad] or [m], those first that the slowest joint reaches soonest from `near` (n,) at `speed`
    (n,) [rad/s] or [m/s]."""
    return motion.nearest_first(np.ascontiguousarray(rows), near, speed)


@lru_cache(maxsize=1024)
def _turns(most: tuple[float, ...]) -> Array:
    """(m, n) [rad] every choice of 0 to `most` full turns of each joint, fewer of those with the most where these are
    too many."""
    while math.prod(turns + 1.0 for turns in most) > MOST_TURNS:
        most = tuple(min(turns, max(most) - 1.0) for turns in most)
    return math.tau * np.array(list(product(*(range(int(turns) + 1) for turns in most))))


_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19)  # standard: the bases of a Halton sequence


def spread(arm: ArmDescription, count: int) -> list[Array]:
    """The first `count` points (n,) [rad] or [m] of Halton's sequence within one turn of every joint."""
    lower, upper = one_turn(arm)
    bases = [_PRIMES[joint % len(_PRIMES)] for joint in range(len(arm.joints))]
    shares = (np.array([_radical_inverse(index, base) for base in bases]) for index in range(1, count + 1))
    return [lower + share * (upper - lower) for share in shares]


def one_turn(arm: ArmDescription) -> tuple[Array, Array]:
    """Lower and upper (n,) [rad] or [m] of where starts are spread."""
    lower, upper = np.array([_turn_of(joint) for joint in arm.joints]).T
    return lower, upper


def _turn_of(joint: Joint) -> tuple[float, float]:
    """Where starts are spread [rad] or [m]: the limits, or the turn nearest to zero within wider ones."""
    if joint.upper - joint.lower <= math.tau:
        return joint.lower, joint.upper
    middle = min(max(0.0, joint.lower + math.pi), joint.upper - math.pi)
    return middle - math.pi, middle + math.pi


def _radical_inverse(index: int, base: int) -> float:
    """The digits of `index` in `base`, mirrored at the point (van der Corput)."""
    value, weight = 0.0, 1.0 / base
    while index:
        index, digit = divmod(index, base)
        value += digit * weight
        weight /= base
    return value
