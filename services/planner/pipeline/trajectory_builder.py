"""Builds a trajectory that may be executed from a path: timed, within what the steppers can do, densely verified."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import PlanRequest, StepMargin, StepPolicy, Timing
from gemelo.services.planner.collision.clearance import PathChecker
from gemelo.services.planner.path.curve import TurnsOnTheSpot
from gemelo.services.planner.path.path import Array, Path, Start
from gemelo.services.planner.path.smoothing import stopping
from gemelo.services.planner.request.deadline import NEVER, Deadline, Stopwatch
from gemelo.services.planner.request.refusals import PlanRefused, not_verified
from gemelo.services.planner.timing.profile import JointLimits, NoProfile, States, stop_and_go, trajectory_of
from gemelo.services.planner.timing.time_optimal import time_optimal_path
from gemelo.services.planner.timing.timing import timed_path
from gemelo.services.planner.verification.feasibility import feasible_scale, require_feasible, slowed
from gemelo.services.planner.verification.verify import (
    BadTrajectory,
    aside,
    look,
    require_ends,
    require_limits,
    states_of,
)

# Tuning constants: chosen, where a line does not say measured or standard.
ASIDE = 1e-9  # [rad] or [m] beside a line that counts as on it: what rounding leaves


class TrajectoryTouches(Exception):
    """The finished trajectory comes too near to something, in `configuration` (n,)."""

    def __init__(self, configuration: Array) -> None:
        super().__init__("the trajectory touches")
        self.configuration = configuration


class VerifiedTrajectory(NamedTuple):
    """What may be executed."""

    trajectory: JointTrajectory
    margins: tuple[StepMargin, ...]
    slowed: float  # 1: not at all


class TrajectoryBuilder:
    """For one request: its limits, its policy, and what must be kept clear of."""

    def __init__(
        self,
        arm: ArmDescription,
        checker: PathChecker,
        request: PlanRequest,
        limits: JointLimits,
        margin: float,
        watch: Stopwatch,
        deadline: Deadline = NEVER,
    ) -> None:
        """Past the `deadline` nothing is begun: `PlanRefused` is raised."""
        self._arm, self._checker, self._request = arm, checker, request
        self._limits, self._margin, self._watch, self._deadline = limits, margin, watch, deadline

    def line(self, start: Start, goal: Start) -> VerifiedTrajectory:
        """The straight line of the joints from `start` to `goal`, (n,) [rad] or [m]; raises `TrajectoryTouches` or
        `PlanRefused`. It is looked at before it is timed; what will be executed is held against it, and looked at again
        wherever it leaves it."""
        ends = np.array((start, goal))
        with self._watch.phase("verification"):
            self._require_free(ends)
        return self._verified(self._stopping(ends), start, goal, ends)

    def path(self, path: Path) -> VerifiedTrajectory:
        """Around its corners or with a stop at each, whichever is faster and free; raises `TrajectoryTouches` or
        `PlanRefused`.

        A joint that must turn back at a corner has to stop there in any case, and so do tight corners cost less time.
        """
        several = [self._stopping(path.corners)]
        with suppress(TurnsOnTheSpot):
            several.append(self._along(path.control))
        faster, *slower = sorted(several, key=_duration)
        try:
            return self._verified(faster, path.start, path.goal)
        except TrajectoryTouches:
            if not slower:
                raise
        return self._verified(slower[0], path.start, path.goal)

    def _verified(
        self, states: States, start: Start, goal: Start, free_line: Array | None = None
    ) -> VerifiedTrajectory:
        with self._watch.phase("timing"):
            trajectory = trajectory_of(self._arm.joint_names, states)
        return self.verified(trajectory, start, goal, free_line, states)

    def _stopping(self, corners: Array) -> States:
        """Straight from corner to corner (m, n), with a stop at each, timed as asked; raises `PlanRefused`."""
        if self._request.timing is Timing.TIME_OPTIMAL:
            return self._along(stopping(corners))
        self._deadline.check()
        with self._watch.phase("timing"):
            return _timed(lambda: stop_and_go(corners, self._limits))

    def _along(self, control: Array) -> States:
        """On the uniform cubic B-spline of `control`, timed as asked; raises `TurnsOnTheSpot` or `PlanRefused`."""
        self._deadline.check()
        with self._watch.phase("timing"):
            if self._request.timing is Timing.TIME_OPTIMAL:
                return _timed(lambda: time_optimal_path(control, self._limits))
            return _timed(lambda: timed_path(control, self._limits))

    def verified(
        self,
        trajectory: JointTrajectory,
        start: Start,
        goal: Start,
        free_line: Array | None = None,
        states: States | None = None,
    ) -> VerifiedTrajectory:
        """The trajectory from `start` to `goal`, (n,) [rad] or [m], slowed where the steppers cannot follow it, then
        verified as it will be executed; raises `TrajectoryTouches` or `PlanRefused`.

        Between the ends of `free_line` (2, n) all is known to be free; `states` are the points of `trajectory`, where
        they are at hand.
        """
        with self._watch.phase("verification"):
            states = states or states_of(trajectory)
            seen = look(states)
            self._require_free(seen.positions, free_line)
            trajectory, margins, scale = self._feasible(trajectory, states)
            if scale < 1.0:
                states = states_of(trajectory)
                seen = look(states)
                self._require_free(seen.positions, free_line)
            try:
                require_ends(trajectory, start, goal)
                require_limits(self._arm, states, seen, self._limits, self._request.timing is Timing.JERK_LIMITED)
            except BadTrajectory as error:
                raise not_verified(error.reason) from error
        return VerifiedTrajectory(trajectory, margins, scale)

    def _require_free(self, rows: Array, free_line: Array | None = None) -> None:
        """Of the polyline through `rows` (m, n), unless all of it lies on the `free_line` (2, n)."""
        self._deadline.check()
        if free_line is not None and lies_on(free_line, rows):
            return
        touching = self._checker.touching(rows, self._margin)
        if touching is not None:
            raise TrajectoryTouches(touching)

    def _feasible(
        self, trajectory: JointTrajectory, states: States
    ) -> tuple[JointTrajectory, tuple[StepMargin, ...], float]:
        try:
            return trajectory, require_feasible(self._arm, trajectory, states), 1.0
        except PlanRefused:
            if self._request.step_policy is StepPolicy.REFUSE:
                raise
        scale = feasible_scale(self._arm, trajectory, self._deadline)
        slower = slowed(trajectory, scale) if scale else trajectory
        return slower, require_feasible(self._arm, slower), scale


def lies_on(line: Array, rows: Array) -> bool:
    """True if all `rows` (m, n) [rad] or [m] lie between the two rows of `line` (2, n), and so what is between them."""
    return aside(line, rows) <= ASIDE


def _duration(states: States) -> float:
    return float(states.times[-1])


def _timed(time: Callable[[], States]) -> States:
    try:
        return time()
    except NoProfile as error:
        raise not_verified(error.reason) from error
