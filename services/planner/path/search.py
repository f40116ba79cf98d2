"""Which search looks for a way, by `planner_id`, and what it asks about collisions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.planning import PlanCode, Refusal
from services.arm.description import Arm
from services.planner.collision.checker import CollisionChecker
from services.planner.path.native_search import NATIVE, native_way
from services.planner.path.nearby_free import with_room
from services.planner.path.ompl_search import PLANNERS, load_ompl, ompl_corners
from services.planner.path.path import NoWay, Way
from services.planner.path.smoothing import continued, shorten, smooth
from services.planner.path.validity import Validity
from services.planner.request.deadline import Deadline, Stopwatch
from services.planner.request.refusals import NoPlan, SearchFailure, unknown_name

if TYPE_CHECKING:
    from services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

DEFAULT = "RRTConnect"  # where the compiled core is not built, or finds nothing
PATIENCE = 0.5  # share of the time left that the compiled core is given, where another may follow
KNOWN = (NATIVE, *PLANNERS)
SEEDS = 2**32  # that are told apart; the generators take none below 0


class Search:
    """All searches for one arm, in the world of the plan at hand."""

    def __init__(self, arm: Arm, surroundings: CollisionChecker) -> None:
        self._arm, self._surroundings = arm, surroundings

    def prepare(self) -> None:
        """Loads what the first search would wait for."""
        load_ompl()

    def find(
        self,
        start: Array,
        goals: Array,
        margin: float,
        planner_id: str,
        seed: int,
        deadline: Deadline,
        watch: Stopwatch,
    ) -> Way:
        """A smooth way from `start` (n,) to one of `goals` (m, n) that keeps `margin` [m]; raises `NoWay`, `NoPlan`."""
        require_known(planner_id)
        core, seed = self._surroundings.native(margin), seed % SEEDS
        if core is None and planner_id == NATIVE:
            raise _not_built()
        sought = _Sought(start, goals, Validity(self._surroundings, margin), seed, watch)
        if core is not None and planner_id in ("", NATIVE):
            try:
                return self._native(core, sought, deadline if planner_id else deadline.share(PATIENCE))
            except NoWay:
                if planner_id or deadline.has_passed():
                    raise
        return self._sampled(planner_id or DEFAULT, sought, deadline)

    def _native(self, core: NativePlanner, sought: _Sought, deadline: Deadline) -> Way:
        """By the compiled core, between where it lets the arm be; from the start and to a goal by straight lines."""
        start, *goals = (
            with_room(self._arm, core, end, sought.validity, sought.seed, deadline)
            for end in (sought.start, *sought.goals)
        )
        if start is None:
            raise NoWay(SearchFailure.START_TOUCHES)
        ends = [(goal, near) for goal, near in zip(sought.goals, goals, strict=True) if near is not None]
        if not ends:
            raise NoWay(SearchFailure.GOAL_TOUCHES)
        way = native_way(core, start, np.array([near for _, near in ends]), sought.seed, deadline)
        goal = next(goal for goal, near in ends if np.array_equal(near, way.corners[-1]))
        return self._joined(sought, start, way, goal, deadline)

    def _joined(self, sought: _Sought, near: Array, way: Way, goal: Array, deadline: Deadline) -> Way:
        """The compiled core's way from near the start to near the goal, continued to both."""
        is_at_goal = np.array_equal(goal, way.corners[-1])
        if near is sought.start and is_at_goal:
            return way
        with sought.watch.phase("smoothing"):
            corners = way.corners if near is sought.start else continued(way.corners, sought.start, sought.validity)
            corners = corners if is_at_goal else continued(corners[::-1], goal, sought.validity)[::-1]
            return Way(corners, smooth(corners, sought.validity, deadline), NATIVE)

    def _sampled(self, planner_id: str, sought: _Sought, deadline: Deadline) -> Way:
        corners = ompl_corners(
            self._arm, planner_id, sought.start, sought.goals, sought.validity, sought.seed, deadline
        )
        with sought.watch.phase("smoothing"):
            corners = shorten(corners, sought.validity, sought.seed, deadline)
            return Way(corners, smooth(corners, sought.validity, deadline), planner_id)


@dataclass(frozen=True)
class _Sought:
    """What all searches are asked: a way from `start` (n,) to one of `goals` (m, n)."""

    start: Array
    goals: Array
    validity: Validity
    seed: int
    watch: Stopwatch


def require_known(planner_id: str) -> None:
    """Raises `NoPlan` with the known ones."""
    if planner_id not in ("", *KNOWN):
        raise unknown_name(PlanCode.INVALID_GOAL_CONSTRAINTS, "unknown planner", planner_id, KNOWN, "gemelo")


def _not_built() -> NoPlan:
    return NoPlan(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        Refusal(
            check="unknown planner",
            subject=NATIVE,
            message="the compiled motion core has not been built here",
            remedy=f"run `make setup`, or ask for {DEFAULT}",
        ),
    )
