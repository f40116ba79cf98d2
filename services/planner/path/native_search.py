"""The native planner as a search, and as the check that the other searches ask; absent where it is not built."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.native.paths import FreePath, NoPath
from gemelo.services.planner.path.path import PathNotFound
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import SearchFailure

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

NATIVE = "native"
# Tuning constants: chosen, where a line does not say measured or standard.
ENOUGH = 500  # configurations checked; measured: with 2,000 paths are 0.1 % shorter, and a plan takes 6 % longer (p50)
REASONS = {"START_TOUCHES": SearchFailure.START_TOUCHES, "GOAL_TOUCHES": SearchFailure.GOAL_TOUCHES}


def native_path(
    core: NativePlanner, start: Array, goals: Array, seed: int, attempts: int, deadline: Deadline
) -> FreePath:
    """A path from `start` (n,) to one of `goals` (m, n), [rad] or [m]: the shortest of as many as `ENOUGH` checks find,
    times `attempts`, and fewer where it is nearly as short as any can be; raises `PathNotFound`.

    Searched, shortened and smoothed by the native planner. The same seed gives the same path where the time does not
    end it.
    """
    enough = attempts * ENOUGH
    path = core.plan(start, goals, seed=seed, time_limit=deadline.left, cancel=deadline.cancel, enough=enough)
    if isinstance(path, NoPath):
        raise PathNotFound(REASONS.get(path.reason.name, SearchFailure.TIMED_OUT))
    return path
