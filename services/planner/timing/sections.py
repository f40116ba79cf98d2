"""A smooth path in sections, in each of which the movement along it has bounds under which no joint exceeds its own.

The compiled core has the same (`native/src/timing/time_law.h`): the timing of one path is shorter than the calls that
would ask Python for its bounds, and without a compiler this one remains. `test_native_timing` holds both together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.curve import Curve
from gemelo.services.planner.timing.bounds import (
    PathDerivatives,
    QuantityLimits,
    acceleration_bound,
    crossing_term,
    jerk_bound,
    speed_bound,
)
from gemelo.services.planner.timing.profile import JointLimits

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
BENDING = 0.8  # share of the acceleration's limit that bending may use
TWISTING = 0.6  # share of the jerk's limit that the bend's own change may use
CROSSING = 0.2  # share of the jerk's limit for accelerating in a bend
CUTS = 2  # sections of a piece, before the ones that are alike become one
SHARES = np.linspace(1e-6, 1.0 - 1e-6, 5)  # of a section, at which its bounds are taken
ALIKE = 1.08  # sections whose speeds differ by less are one; chosen: a change of speed would cost more than it wins
STRAIGHT = 1e-9  # 1/s of bend below which a piece is straight
TINY = 1e-12  # chosen: added to derivatives, so that nothing is divided by 0
NEARLY = 1.0 - 1e-9  # of a change of speed, lest rounding leaves no profile for it


@dataclass(frozen=True)
class Section:
    """A stretch of the path with bounds of the movement along it."""

    length: float  # [s at full speed]
    speed: float
    acceleration: float
    jerk: float
    bends: bool


def sections_of(run: Curve, limits: JointLimits) -> list[Section]:
    """Some for each piece of the curve, with the bounds of all their samples; those that are alike are one."""
    lengths, derivatives = run.cut(CUTS, SHARES)
    path = PathDerivatives(*(np.abs(part) + TINY for part in derivatives[1:]))
    scale = limits.velocity  # joint values are divided by their velocity limits
    of_joints = QuantityLimits(np.ones_like(scale), limits.acceleration / scale, limits.jerk / scale)
    v = _least(speed_bound(path, of_joints, BENDING, TWISTING))
    speed = np.repeat(v, len(SHARES))[:, None]
    a = _least(acceleration_bound(path, of_joints, speed, CROSSING))
    crossed = np.minimum(CROSSING * of_joints.jerk, crossing_term(path, speed, of_joints.acceleration / path.first))
    j = _least(jerk_bound(path, of_joints, speed, crossed))
    bends = _least(-path.second) < -STRAIGHT
    rows = zip(*(column.tolist() for column in (lengths, v, a, j, bends)), strict=True)
    return _merged([Section(*row) for row in rows])


def boundary_speeds(sections: list[Section]) -> list[float]:
    """Steady speeds at the ends of the sections, one more than sections: dimensionless, path length [s at full speed]
    per s. They can be reached from rest and brought to rest."""
    speeds = [0.0, *(min(one.speed, other.speed) for one, other in pairwise(sections)), 0.0]
    for index, section in enumerate(sections[:-1]):
        speeds[index + 1] = min(speeds[index + 1], _reachable(speeds[index], section))
    for index in range(len(sections) - 1, 0, -1):
        speeds[index] = min(speeds[index], _reachable(speeds[index + 1], sections[index]))
    return speeds


def _least(rows: Array) -> Array:
    """(k,) the least of all samples and joints of each section."""
    least: Array = rows.reshape(-1, len(SHARES) * rows.shape[1]).min(axis=1)
    return least


def _merged(sections: list[Section]) -> list[Section]:
    """Fewer of them: neighbours that are about as fast become one, under the bounds of the slower."""
    merged = [sections[0]]
    for section in sections[1:]:
        last = merged[-1]
        if max(last.speed, section.speed) <= ALIKE * min(last.speed, section.speed):
            merged[-1] = Section(
                last.length + section.length,
                min(last.speed, section.speed),
                min(last.acceleration, section.acceleration),
                min(last.jerk, section.jerk),
                last.bends or section.bends,
            )
        else:
            merged.append(section)
    return merged


def _reachable(speed: float, section: Section) -> float:
    """The fastest steady speed at the other end of the section.

    A change c of the speed v takes the length (2 v + c) (c / j)^0.5, or (2 v + c) (c / a + a / j) / 2 where it is so
    large that the acceleration's limit is reached: a cubic in c^0.5 (Cardano's formula), and a quadratic in c.
    """
    a, j, length = section.acceleration, section.jerk, section.length
    third, half = 2.0 * speed / 3.0, 0.5 * length * math.sqrt(j)
    if third > TINY * math.cbrt(half) ** 2:
        root = 2.0 * math.sqrt(third) * math.sinh(math.asinh(half / (third * math.sqrt(third))) / 3.0)
    else:
        root = math.cbrt(2.0 * half)
    change = root * root
    if change * j > a * a:
        b = a / j + 2.0 * speed / a
        c = 2.0 * (length - speed * a / j)
        change = 2.0 * c / (b + math.sqrt(b * b + 4.0 * c / a))
    return min(speed + NEARLY * change, max(speed, section.speed))
