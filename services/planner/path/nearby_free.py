"""From where only the exact shapes let the arm be, a short straight way to where the compiled core lets it be too."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm
from services.planner.path.validity import Validity
from services.planner.request.deadline import Deadline

if TYPE_CHECKING:
    from services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

NEAREST, FARTHEST = 0.02, 1.3  # [s] at full speed: how far from the posture is looked first and last
SAMPLES = 64  # postures at each distance, which doubles
SPARE = 0.0003  # [m] beyond the margin: with none the core finds no line free that begins there
TRIED = 3  # of them, the nearest, to which the straight way is looked at


def with_room(
    arm: Arm, core: NativePlanner, posture: Array, validity: Validity, seed: int, deadline: Deadline
) -> Array | None:
    """`posture` (n,) itself where the core lets it move, else a near one where it does, None where none was found."""
    if _can_move(core, posture):
        return posture
    for rows in _around(arm, posture, seed):
        for row in rows[core.free(rows)][:TRIED]:
            if _can_move(core, row) and validity.is_line_free(posture, row):
                return np.asarray(row)
        if deadline.has_passed():
            break
    return None


def _can_move(core: NativePlanner, posture: Array) -> bool:
    most = core.margin + SPARE
    return core.distance(posture, most) >= most


def _around(arm: Arm, posture: Array, seed: int) -> Iterator[Array]:
    """(m, n) postures within the limits, nearest first, from farther and farther away."""
    random = np.random.default_rng(seed)
    speed = np.array([joint.velocity for joint in arm.joints])
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    distance = NEAREST
    while distance < FARTHEST:
        steps = distance * random.uniform(-1.0, 1.0, (SAMPLES, len(speed)))
        rows = np.clip(posture + speed * steps, lower, upper)
        yield rows[np.argsort(np.abs(steps).max(axis=1), kind="stable")]
        distance *= 2.0
