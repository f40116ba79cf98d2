"""Short straight path from where only the exact shapes are free to where the native planner's spheres are free too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
NEAREST, FARTHEST = 0.02, 1.3  # [s] at full speed: how far from the configuration is looked first and last
SAMPLES = 64  # configurations at each distance, which doubles; chosen: native checks of so many take well under 1 ms
SPARE = 0.0003  # [m] beyond the margin: with none the native planner finds no line free that begins there
TRIED = 3  # of them, the nearest, to which the straight path is looked at


def nearby_free(
    arm: ArmDescription,
    core: NativePlanner,
    ends: list[Array],
    validity: ValidityChecker,
    seed: int,
    deadline: Deadline,
) -> list[Array | None]:
    """For each of `ends` (n,) [rad] or [m] itself where the native planner lets it move, else a near one where it does;
    None where none was found."""
    return [
        end if is_free else _nearby(arm, core, end, validity, seed, deadline)
        for end, is_free in zip(ends, core.free(ends, SPARE).tolist(), strict=True)
    ]


def _nearby(
    arm: ArmDescription,
    core: NativePlanner,
    configuration: Array,
    validity: ValidityChecker,
    seed: int,
    deadline: Deadline,
) -> Array | None:
    for rows in _around(arm, configuration, seed):
        for row in rows[core.free(rows, SPARE)][:TRIED]:
            if validity.is_line_free(configuration, row):
                return np.asarray(row)
        if deadline.has_passed():
            break
    return None


def _around(arm: ArmDescription, configuration: Array, seed: int) -> Iterator[Array]:
    """(m, n) configurations within the limits, nearest first, from farther and farther away."""
    random = np.random.default_rng(seed)
    speed = np.array([joint.velocity for joint in arm.joints])
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    distance = NEAREST
    while distance < FARTHEST:
        steps = distance * random.uniform(-1.0, 1.0, (SAMPLES, len(speed)))
        rows = np.clip(configuration + speed * steps, lower, upper)
        yield rows[np.argsort(np.abs(steps).max(axis=1), kind="stable")]
        distance *= 2.0
