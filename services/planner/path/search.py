"""Path search in the joint space: the searches by `planner_id`, and the native planner before all others."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planners import DEFAULT, NAMES, NATIVE, PLANNERS, planner_named
from gemelo.schemas.planning import PlanCode
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.native.paths import FreePath, NoPath
from gemelo.services.planner.path import searches
from gemelo.services.planner.path.nearby_free import nearby_free
from gemelo.services.planner.path.ompl_problem import load_ompl
from gemelo.services.planner.path.path import Path, PathNotFound, Sought
from gemelo.services.planner.path.smoothing import Rounded, shorten, smooth, smooth_unknown
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline, Stopwatch
from gemelo.services.planner.request.refusals import PlanRefused, SearchFailure, refusal_of, unknown_name

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

Corners = Callable[[Sought, str, Deadline], Array]  # of a planner by its name; raises `PathNotFound`
# Tuning constants: chosen, where a line does not say measured or standard.
PATIENCE = 0.5  # share of the time left that the native planner is given, where another may follow
ENOUGH = 500  # configurations checked; measured: with 2,000 paths are 0.1 % shorter, and a plan takes 6 % longer (p50)
SEEDS = 2**32  # that are told apart; the generators take none below 0
REASONS = {"START_TOUCHES": SearchFailure.START_TOUCHES, "GOAL_TOUCHES": SearchFailure.GOAL_TOUCHES}


class Search:
    """All searches for one arm, in the world of the plan at hand."""

    def __init__(self, arm: ArmDescription, checker: CollisionChecker) -> None:
        self._arm, self._checker = arm, checker

    def prepare(self) -> None:
        """Loads what the first search would wait for."""
        load_ompl()
        for row in PLANNERS:
            if row.search:
                _search_of(row.name)

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
        are_lines_blocked: bool = False,
    ) -> Path:
        """A smooth path from `start` (n,) to one of `goals` (m, n) that keeps `margin` [m], after as many `attempts` as
        usual for a shorter one; with `are_lines_blocked` no straight line is free. Raises `PathNotFound`,
        `PlanRefused`."""
        require_known(planner_id)
        core, seed = self._checker.native(margin), seed % SEEDS
        if core is None and planner_id == NATIVE:
            raise _not_built()
        sought = Sought(self._arm, start, goals, ValidityChecker(self._checker, margin), seed, attempts, watch)
        if core is not None and planner_id in ("", NATIVE):
            try:
                until = deadline if planner_id else deadline.share(PATIENCE)
                return self._native(core, sought, until, are_lines_blocked)
            except PathNotFound:
                if planner_id or deadline.has_passed():
                    raise
        return self._sampled(planner_id or DEFAULT, sought, deadline)

    def _native(self, core: NativePlanner, sought: Sought, deadline: Deadline, are_lines_blocked: bool) -> Path:
        """By the native planner, between where it lets the arm be; from the start and to a goal by straight lines."""
        start, *goals = nearby_free(
            self._arm, core, [sought.start, *sought.goals], sought.validity, sought.seed, deadline
        )
        if start is None:
            raise PathNotFound(SearchFailure.START_TOUCHES)
        ends = [(goal, near) for goal, near in zip(sought.goals, goals, strict=True) if near is not None]
        if not ends:
            raise PathNotFound(SearchFailure.GOAL_TOUCHES)
        is_moved = start is not sought.start or any(near is not goal for goal, near in ends)
        nears = np.array([near for _, near in ends])
        blocked = are_lines_blocked and not is_moved
        path = native_path(core, start, nears, sought.seed, sought.attempts, deadline, blocked)
        reached = path.corners[-1].tolist()
        goal = next(goal for goal, near in ends if near.tolist() == reached)
        return self._joined(sought, start, path, goal, deadline)

    def _joined(self, sought: Sought, near: Array, path: FreePath, goal: Array, deadline: Deadline) -> Path:
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

    def _sampled(self, planner_id: str, sought: Sought, deadline: Deadline) -> Path:
        corners = sampled_corners(sought, planner_id, deadline)
        with sought.watch.phase("smoothing"):
            corners = shorten(corners, sought.validity, sought.seed, deadline)
            return Path(corners, smooth(corners, sought.validity, deadline), planner_id)


def sampled_corners(sought: Sought, planner_id: str, deadline: Deadline) -> Array:
    """Corners (m, n) [rad] or [m] of a polyline from the start to one of the goals, exact at both ends, by the search
    of the planner's row; raises `PathNotFound`."""
    corners = _search_of(planner_id)(sought, planner_id, deadline)
    nearest = int(np.argmin(np.abs(sought.goals - corners[-1]).max(axis=1)))
    corners[0], corners[-1] = sought.start, sought.goals[nearest]
    return corners


def _search_of(planner_id: str) -> Corners:
    search: Corners = import_module(f"{searches.__name__}.{planner_named(planner_id).search}").corners
    return search


def native_path(
    core: NativePlanner,
    start: Array,
    goals: Array,
    seed: int,
    attempts: int,
    deadline: Deadline,
    are_lines_blocked: bool = False,
) -> FreePath:
    """A path from `start` (n,) to one of `goals` (m, n), [rad] or [m]: the shortest of as many as `ENOUGH` checks find,
    times `attempts`, and fewer where it is nearly as short as any can be; raises `PathNotFound`.

    Searched, shortened and smoothed by the native planner; no straight line is looked at where `are_lines_blocked`. The
    same seed gives the same path where the time does not end it.
    """
    enough = attempts * ENOUGH
    path = core.plan(start, goals, seed, deadline.left, deadline.cancel, enough, are_lines_blocked)
    if isinstance(path, NoPath):
        raise PathNotFound(REASONS.get(path.reason.name, SearchFailure.TIMED_OUT))
    return path


def require_known(planner_id: str) -> None:
    """Raises `PlanRefused` with the known ones."""
    if planner_id not in ("", *NAMES):
        raise unknown_name(PlanCode.INVALID_GOAL_CONSTRAINTS, "unknown planner", planner_id, NAMES, "gemelo")


def _not_built() -> PlanRefused:
    why = because("plan.planner.not_built", remedy("make_setup"), remedy("use_name", name=DEFAULT))
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal_of(why, "unknown planner", NATIVE))
