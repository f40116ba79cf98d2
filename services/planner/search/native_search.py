"""The compiled core as a search, and as the check that the other searches ask; absent where it is not built."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm
from services.planner.covers.shapes import Attachment, Shape
from services.planner.search.way import Deadline, Flag, NoWay, Way, Why

if TYPE_CHECKING:
    from services.planner.native import FreePath, MotionCore

Array = NDArray[np.float64]

NATIVE = "native"
ENOUGH = 12_000  # configurations checked: the median of a first search is 4,400
STRIDE = 1_000_003  # from seed to seed: the next request's is another one
REASONS = {"START_TOUCHES": Why.START_TOUCHES, "GOAL_TOUCHES": Why.GOAL_TOUCHES}


def cancel_flag() -> Flag:
    """One that the compiled core heeds; any, where it is not built."""
    try:
        from services.planner.native import CancelFlag
    except ImportError:
        return threading.Event()
    return CancelFlag()


def native_core(arm: Arm) -> MotionCore | None:
    """The core for this arm, None where it is not built; takes seconds, for the spheres are fitted."""
    try:
        from services.planner.native import MotionCore
    except ImportError:
        return None
    return MotionCore(arm)


def show_scene(core: MotionCore, around: list[Shape], carried: list[Attachment]) -> None:
    """What the core is to keep clear of from now on; raises ValueError for a scene that cannot be."""
    core.set_scene(())
    for name in core.attached:
        core.detach(name)
    for attachment in carried:
        core.attach(attachment)
    core.set_scene(around)


def native_way(core: MotionCore, start: Array, goals: Array, seed: int, deadline: Deadline) -> Way:
    """From `start` (n,) to one of `goals` (m, n): the shortest of as many as `ENOUGH` checks find; raises `NoWay`.

    Searched, shortened and smoothed by the core. The same seed gives the same way where the time does not end it.
    """
    best = _path(core, start, goals, seed, deadline)
    spent = best.effort.checks
    while spent < ENOUGH and not deadline.is_late():
        seed = (seed + STRIDE) % 2**32
        try:
            path = _path(core, start, goals, seed, deadline)
        except NoWay:
            break
        spent += path.effort.checks
        best = min(best, path, key=lambda path: _length(core.arm, path.corners))
    return Way(best.corners, best.control, NATIVE)


def _path(core: MotionCore, start: Array, goals: Array, seed: int, deadline: Deadline) -> FreePath:
    from services.planner.native import CancelFlag, NoPath

    cancel = deadline.cancel if isinstance(deadline.cancel, CancelFlag) else None
    path = core.plan(start, goals, seed=seed, time_limit=deadline.left, cancel=cancel)
    if isinstance(path, NoPath):
        raise NoWay(REASONS.get(path.why.name, Why.TIMED_OUT))
    return path


def _length(arm: Arm, corners: Array) -> float:
    """[s] at full speed, the slowest joint's, from corner to corner."""
    moves = np.abs(np.diff(corners, axis=0)) / [joint.velocity for joint in arm.joints]
    return float(moves.max(axis=1).sum())
