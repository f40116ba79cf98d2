"""The native planner as a search, and as the check that the other searches ask; absent where it is not built."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from services.arm.model.description import Arm
from services.planner.native.paths import FreePath, NoPath
from services.planner.path.path import Path, PathNotFound
from services.planner.request.deadline import Deadline
from services.planner.request.refusals import SearchFailure

if TYPE_CHECKING:
    from services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

NATIVE = "native"
# Tuning constants: chosen, where a line does not say measured or standard.
ENOUGH = 12_000  # configurations checked; measured: the median of a first search is 4,400 (plan_ms)
STRIDE = 1_000_003  # from seed to seed: the next request's is another one
REASONS = {"START_TOUCHES": SearchFailure.START_TOUCHES, "GOAL_TOUCHES": SearchFailure.GOAL_TOUCHES}


def native_path(core: NativePlanner, start: Array, goals: Array, seed: int, deadline: Deadline) -> Path:
    """A path from `start` (n,) to one of `goals` (m, n), [rad] or [m]: the shortest of as many as `ENOUGH` checks find;
    raises `PathNotFound`.

    Searched, shortened and smoothed by the native planner. The same seed gives the same path where the time does not
    end it.
    """
    best = _path(core, start, goals, seed, deadline)
    spent = best.effort.checks
    while spent < ENOUGH and not deadline.has_passed():
        seed = (seed + STRIDE) % 2**32
        try:
            path = _path(core, start, goals, seed, deadline)
        except PathNotFound:
            break
        spent += path.effort.checks
        best = min(best, path, key=lambda path: _length(core.arm, path.corners))
    return Path(best.corners, best.control, NATIVE)


def _path(core: NativePlanner, start: Array, goals: Array, seed: int, deadline: Deadline) -> FreePath:
    path = core.plan(start, goals, seed=seed, time_limit=deadline.left, cancel=deadline.cancel)
    if isinstance(path, NoPath):
        raise PathNotFound(REASONS.get(path.reason.name, SearchFailure.TIMED_OUT))
    return path


def _length(arm: Arm, corners: Array) -> float:
    """[s] at full speed, the slowest joint's, from corner to corner."""
    moves = np.abs(np.diff(corners, axis=0)) / [joint.velocity for joint in arm.joints]
    return float(moves.max(axis=1).sum())
