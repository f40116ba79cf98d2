"""Path search in the joint space: the searches by `planner_id`, and the native planner before all others."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planning import PlanCode, Refusal
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.path.native_search import NATIVE, native_path
from gemelo.services.planner.path.nearby_free import nearby_free
from gemelo.services.planner.path.ompl_search import PLANNERS, load_ompl, ompl_corners
from gemelo.services.planner.path.path import Path, PathNotFound
from gemelo.services.planner.path.smoothing import Rounded, shorten, smooth, smooth_unknown
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline, Stopwatch
from gemelo.services.planner.request.refusals import PlanRefused, SearchFailure, unknown_name

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner
    from gemelo.services.planner.native.paths import FreePath

Array = NDArray[np.float64]

DEFAULT = "RRTConnect"  # where the native planner is not built, or finds nothing
# Tuning constants: chosen, where a line does not say measured or standard.
PATIENCE = 0.5  # share of the time left that the native planner is given, where another may follow
KNOWN = (NATIVE, *PLANNERS)
SEEDS = 2**32  # that are told apart; the generators take none below 0


class Search:
    """All searches for one arm, in the world of the plan at hand."""

    def __init__(self, arm: ArmDescription, checker: CollisionChecker) -> None:
        self._arm, self._checker = arm, checker

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
        attempts: int = 1,
    ) -> Path:
        """A smooth path from `start` (n,) to one of `goals` (m, n) that keeps `margin` [m], after as many `attempts` as
        usual for a shorter one; raises `PathNotFound`, `PlanRefused`."""
        require_known(planner_id)
        core, seed = self._checker.native(margin), seed % SEEDS
        if core is None and planner_id == NATIVE:
            raise _not_built()
        sought = _Sought(start, goals, ValidityChecker(self._checker, margin), seed, attempts, watch)
        if core is not None and planner_id in ("", NATIVE):
            try:
                return self._native(core, sought, deadline if planner_id else deadline.share(PATIENCE))
            except PathNotFound:
                if planner_id or deadline.has_passed():
                    raise
        return self._sampled(planner_id or DEFAULT, sought, deadline)

    def _native(self, core: NativePlanner, sought: _Sought, deadline: Deadline) -> Path:
        """By the native planner, between where it lets the arm be; from the start and to a goal by straight lines."""
        start, *goals = nearby_free(
            self._arm, core, [sought.start, *sought.goals], sought.validity, sought.seed, deadline
        )
        if start is None:
            raise PathNotFound(SearchFailure.START_TOUCHES)
        ends = [(goal, near) for goal, near in zip(sought.goals, goals, strict=True) if near is not None]
        if not ends:
            raise PathNotFound(SearchFailure.GOAL_TOUCHES)
        path = native_path(core, start, np.array([near for _, near in ends]), sought.seed, sought.attempts, deadline)
        reached = path.corners[-1].tolist()
        goal = next(goal for goal, near in ends if near.tolist() == reached)
        return self._joined(sought, start, path, goal, deadline)

    def _joined(self, sought: _Sought, near: Array, path: FreePath, goal: Array, deadline: Deadline) -> Path:
        """The native planner's path from near the start to near the goal, continued to both; where it is not, the curve
        stays as it is."""
        is_at_goal = goal.tolist() == path.corners[-1].tolist()
        if near is sought.start and is_at_goal:
            return Path(path.corners, path.control, NATIVE)
        with sought.watch.phase("smoothing"):
            rounded = Rounded(path.corners, path.shares)
            if near is not sought.start:
                rounded = rounded.continued(sought.start, sought.validity)
            if not is_at_goal:
                rounded = rounded.turned.continued(goal, sought.validity).turned
            return Path(rounded.corners, smooth_unknown(rounded, sought.validity, deadline), NATIVE)

    def _sampled(self, planner_id: str, sought: _Sought, deadline: Deadline) -> Path:
        corners = ompl_corners(
            self._arm, planner_id, sought.start, sought.goals, sought.validity, sought.seed, deadline
        )
        with sought.watch.phase("smoothing"):
            corners = shorten(corners, sought.validity, sought.seed, deadline)
            return Path(corners, smooth(corners, sought.validity, deadline), planner_id)


class _Sought(NamedTuple):
    """What all searches are asked: a path from `start` (n,) to one of `goals` (m, n)."""

    start: Array
    goals: Array
    validity: ValidityChecker
    seed: int
    attempts: int
    watch: Stopwatch


def require_known(planner_id: str) -> None:
    """Raises `PlanRefused` with the known ones."""
    if planner_id not in ("", *KNOWN):
        raise unknown_name(PlanCode.INVALID_GOAL_CONSTRAINTS, "unknown planner", planner_id, KNOWN, "gemelo")


def _not_built() -> PlanRefused:
    return PlanRefused(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        Refusal(
            check="unknown planner",
            subject=NATIVE,
            message="the native planner has not been built here",
            remedy=f"run `make setup`, or ask for {DEFAULT}",
        ),
    )
