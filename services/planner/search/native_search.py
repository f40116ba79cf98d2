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
    from services.planner.native import MotionCore

Array = NDArray[np.float64]

NATIVE = "native"
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
    """From `start` (n,) to one of `goals` (m, n), searched, shortened and smoothed by the core; raises `NoWay`."""
    from services.planner.native import CancelFlag, NoPath

    cancel = deadline.cancel if isinstance(deadline.cancel, CancelFlag) else None
    path = core.plan(start, goals, seed=seed, time_limit=deadline.left, cancel=cancel)
    if isinstance(path, NoPath):
        raise NoWay(REASONS.get(path.why.name, Why.TIMED_OUT))
    return Way(path.corners, path.control, NATIVE)
