"""How near links may come, and how far the arm can go towards a posture before they do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.arm.collisions import SelfCollisions

Array = NDArray[np.float64]

CLEARANCE = 0.004  # [m] that links which may not touch keep between them
LOOKS = 50  # along the way


def last_free(collisions: SelfCollisions, start: Array, goal: Array) -> Array:
    """The last posture (n,) on the straight line from `start` to `goal` before links come nearer than the clearance."""
    if collisions.distance(goal) > CLEARANCE:
        return goal
    last = start
    for share in np.linspace(0.0, 1.0, LOOKS + 1)[1:]:
        posture: Array = start + share * (goal - start)
        if collisions.distance(posture) <= CLEARANCE:
            break
        last = posture
    return last
