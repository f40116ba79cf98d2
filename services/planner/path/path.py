"""The question of a search and its result: a collision-free joint path, or the reason why none was found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Stopwatch
from gemelo.services.planner.request.refusals import SearchFailure

Array = NDArray[np.float64]
Start = tuple[float, ...]

STRAIGHT = "straight"  # the planner_id of joint lines, which no search is needed for


class Sought(NamedTuple):
    """What all searches are asked: a path from `start` (n,) to one of `goals` (m, n), [rad] or [m]."""

    arm: ArmDescription
    start: Array
    goals: Array
    validity: ValidityChecker
    seed: int
    attempts: int
    watch: Stopwatch


class PathNotFound(Exception):
    """None was found."""

    def __init__(self, reason: SearchFailure) -> None:
        super().__init__(reason.value)
        self.reason = reason


class Path(NamedTuple):
    """A free path: the polyline of `corners` (m, n), and the uniform cubic B-spline of `control` (k, n) in its place.

    Both ends of the curve are there three times, so that it begins and ends exactly there.
    """

    corners: Array
    control: Array
    planner_id: str

    @property
    def start(self) -> Start:
        """Joint values (n,) [rad] or [m] at which the path begins, to the bit."""
        return tuple(self.control[0].tolist())

    @property
    def goal(self) -> Start:
        """Joint values (n,) [rad] or [m] at which the path ends, to the bit."""
        return tuple(self.control[-1].tolist())
