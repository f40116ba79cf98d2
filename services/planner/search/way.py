"""What a search ends with, and how much time it has."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Start = tuple[float, ...]

STRAIGHT = "straight"  # the planner_id of joint lines, which no search is needed for


class Why(StrEnum):
    """Why there is no way."""

    TIMED_OUT = "timed out"
    START_TOUCHES = "start touches"
    GOAL_TOUCHES = "goal touches"


class NoWay(Exception):
    """None was found."""

    def __init__(self, why: Why) -> None:
        super().__init__(why.value)
        self.why = why


@dataclass(frozen=True)
class Way:
    """A free way: the polyline of `corners` (m, n), and the uniform cubic B-spline of `control` (k, n) in its place.

    Both ends of the curve are there three times, so that it begins and ends exactly there.
    """

    corners: Array
    control: Array
    planner_id: str

    @property
    def start(self) -> Start:
        """Where it begins, to the bit."""
        return tuple(self.control[0].tolist())

    @property
    def goal(self) -> Start:
        """Where it ends, to the bit."""
        return tuple(self.control[-1].tolist())


def endless() -> float:
    """A clock that stands, so that nothing is ever late."""
    return 0.0


class Flag(Protocol):
    """Set from another thread to cancel a plan: the compiled core's `CancelFlag`, or a `threading.Event`."""

    def set(self) -> None: ...

    def is_set(self) -> bool: ...


@dataclass(frozen=True)
class Deadline:
    """`clock` in s; what began at `began` may take `allowed`, and no more once it is cancelled."""

    clock: Callable[[], float] = endless
    allowed: float = math.inf
    began: float = 0.0
    cancel: Flag | None = None

    @property
    def left(self) -> float:
        """[s], at least 0."""
        if self.cancel is not None and self.cancel.is_set():
            return 0.0
        return max(0.0, self.allowed - (self.clock() - self.began))

    def is_late(self) -> bool:
        return self.left <= 0.0

    def share(self, part: float) -> Deadline:
        """Within this one: of the time that is left only a part."""
        now = self.clock()
        return replace(self, allowed=part * (self.allowed - (now - self.began)), began=now)
