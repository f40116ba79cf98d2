"""Where searches for a posture start: spread evenly over the limits, and the same in every run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm, Joint

Array = NDArray[np.float64]

_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19)


def spread(arm: Arm, count: int) -> list[Array]:
    """The first points (n,) of Halton's sequence within one turn of every joint."""
    lower, upper = one_turn(arm)
    bases = [_PRIMES[joint % len(_PRIMES)] for joint in range(len(arm.joints))]
    shares = (np.array([_radical_inverse(index, base) for base in bases]) for index in range(1, count + 1))
    return [lower + share * (upper - lower) for share in shares]


def one_turn(arm: Arm) -> tuple[Array, Array]:
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
