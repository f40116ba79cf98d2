"""From a way to a trajectory that may be executed: timed, within what the steppers can do, and looked at densely."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from schemas.motion import JointTrajectory
from schemas.planning import PlanRequest, StepMargin, StepPolicy, Timing
from services.arm.description import Arm
from services.planner.collision.clearance import Sweeper
from services.planner.path.curve import TurnsOnTheSpot
from services.planner.path.path import Array, Start, Way
from services.planner.path.smoothing import stopping
from services.planner.request.deadline import Stopwatch
from services.planner.request.refusals import NoPlan, not_verified
from services.planner.timing.profile import JointLimits, NoProfile, stop_and_go
from services.planner.timing.time_optimal import time_optimal_way
from services.planner.timing.timing import timed_way
from services.planner.verification.feasibility import feasible_scale, require_feasible, slowed
from services.planner.verification.verify import (
    BadTrajectory,
    require_ends,
    require_jerk,
    require_within_limits,
    sample,
)


class Touching(Exception):
    """The finished trajectory comes too near to something, in `posture` (n,)."""

    def __init__(self, posture: Array) -> None:
        super().__init__("the trajectory touches")
        self.posture = posture


@dataclass(frozen=True)
class Finished:
    """What may be executed."""

    trajectory: JointTrajectory
    margins: tuple[StepMargin, ...]
    slowed: float  # 1: not at all


class Finisher:
    """For one request: its limits, its policy, and what must be kept clear of."""

    def __init__(
        self, arm: Arm, checker: Sweeper, request: PlanRequest, limits: JointLimits, margin: float, watch: Stopwatch
    ) -> None:
        self._arm, self._checker, self._request = arm, checker, request
        self._limits, self._margin, self._watch = limits, margin, watch

    def line(self, start: Start, goal: Start) -> Finished:
        """The straight line of the joints; raises `Touching` or `NoPlan`."""
        return self.finish(self._stopping(np.array((start, goal))), start, goal)

    def way(self, way: Way) -> Finished:
        """Around its corners or with a stop at each, whichever is faster and free; raises `Touching` or `NoPlan`.

        A joint that must turn back at a corner has to stop there in any case, and so do tight corners cost less time.
        """
        trajectories = [self._stopping(way.corners)]
        with suppress(TurnsOnTheSpot):
            trajectories.append(self._along(way.control))
        faster, *slower = sorted(trajectories, key=_duration)
        try:
            return self.finish(faster, way.start, way.goal)
        except Touching:
            if not slower:
                raise
        return self.finish(slower[0], way.start, way.goal)

    def _stopping(self, corners: Array) -> JointTrajectory:
        """Straight from corner to corner (m, n), with a stop at each, timed as asked; raises `NoPlan`."""
        if self._request.timing is Timing.TIME_OPTIMAL:
            return self._along(stopping(corners))
        with self._watch.phase("timing"):
            return _timed(lambda: stop_and_go(self._arm.joint_names, corners.tolist(), self._limits))

    def _along(self, control: Array) -> JointTrajectory:
        """On the uniform cubic B-spline of `control`, timed as asked; raises `TurnsOnTheSpot` or `NoPlan`."""
        names = self._arm.joint_names
        with self._watch.phase("timing"):
            if self._request.timing is Timing.TIME_OPTIMAL:
                return _timed(lambda: time_optimal_way(names, control, self._limits))
            return _timed(lambda: timed_way(names, control, self._limits))

    def finish(self, trajectory: JointTrajectory, start: Start, goal: Start) -> Finished:
        """Slower where the steppers cannot, then verified as it will be played; raises `Touching` or `NoPlan`."""
        with self._watch.phase("verification"):
            samples = sample(trajectory)
            self._require_free(samples.positions)
            trajectory, margins, scale = self._feasible(trajectory)
            if scale < 1.0:
                samples = sample(trajectory)
                self._require_free(samples.positions)
            try:
                require_ends(trajectory, start, goal)
                require_within_limits(self._arm, samples, self._limits)
                if self._request.timing is Timing.JERK_LIMITED:
                    require_jerk(self._arm, samples, self._limits)
            except BadTrajectory as error:
                raise not_verified(str(error)) from error
        return Finished(trajectory, margins, scale)

    def _require_free(self, rows: Array) -> None:
        touching = self._checker.touching(rows, self._margin)
        if touching is not None:
            raise Touching(touching)

    def _feasible(self, trajectory: JointTrajectory) -> tuple[JointTrajectory, tuple[StepMargin, ...], float]:
        try:
            return trajectory, require_feasible(self._arm, trajectory), 1.0
        except NoPlan:
            if self._request.step_policy is StepPolicy.REFUSE:
                raise
        scale = feasible_scale(self._arm, trajectory)
        slower = slowed(trajectory, scale) if scale else trajectory
        return slower, require_feasible(self._arm, slower), scale


def _duration(trajectory: JointTrajectory) -> float:
    return trajectory.points[-1].time_from_start


def _timed(time: Callable[[], JointTrajectory]) -> JointTrajectory:
    try:
        return time()
    except NoProfile as error:
        raise not_verified(str(error)) from error
