"""Paths of the tool: lines, arcs and rounded polylines followed by the joints, as far as they go, and timed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import PlanCode, Refusal, Timing
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.cartesian.continuation import FINEST, Continuation, FollowedPath, StopReason, is_same
from gemelo.services.planner.cartesian.path_points import Run, between, states_of_runs
from gemelo.services.planner.cartesian.tool_limits import ToolLimits
from gemelo.services.planner.cartesian.tool_path import METRES_PER_RADIAN, ToolPath
from gemelo.services.planner.collision.clearance import PathChecker
from gemelo.services.planner.path.path import Start
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import (
    PlanRefused,
    near_pairs,
    not_verified,
    objects_in,
    refusal_of,
    without_remedies,
)
from gemelo.services.planner.timing.path_timing import law_along
from gemelo.services.planner.timing.profile import (
    JointLimits,
    NoProfile,
    States,
    require_short,
    straight_line,
    trajectory_of,
)
from gemelo.services.planner.timing.timing import at_limits, at_speed

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
DEEPER = 1.06  # share of the margin that the path keeps, so that samples taken elsewhere keep the margin itself
LEAST_LOOK = 0.1  # share of the margin by which the arm moves on at least from one look to the next
SHORTEST_PATH = 1e-4  # of length: less is no path; chosen: below it a joint moves less than a step
SHORTEST_TOLD = 1e-6  # [m] of a path, of which a place is told in metres
MOST_ROWS = 4000  # chosen: bounds the time of the limits' check on long paths
MOMENT = 0.05  # share of the time between two points, by which the tool is looked at before and after a moment


@dataclass(frozen=True)
class CartesianPath:
    """A timed path, not yet verified; `stopped_by` says why it is not all of it."""

    trajectory: JointTrajectory
    end: Start
    fraction: float
    stopped_by: Refusal | None


@dataclass(frozen=True)
class CartesianTerms:
    """On which a path is gone."""

    limits: JointLimits
    tool: ToolLimits
    margin: float  # [m]
    timing: Timing
    deadline: Deadline


class CartesianPlanner:
    """Takes one arm along paths of its tool, among what `checker` knows."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, checker: PathChecker, holds_turn: bool) -> None:
        self._arm, self._kinematics, self._checker = arm, kinematics, checker
        self._continuation = Continuation(arm, kinematics, holds_turn)

    def plan(self, paths: Sequence[ToolPath], start: Start, end: Start | None, terms: CartesianTerms) -> CartesianPath:
        """The path of the joints from `start` (n,) [rad] or [m] along `paths`, at rest between them; raises
        `PlanRefused`, and what `terms.deadline` raises.

        Where the path leads to `end` (n,) but for rounding, it ends there to the bit. A path that moves no joint gives
        a plan that stands still.
        """
        whole, before = sum(path.length for path in paths), 0.0
        metres = sum(path.metres for path in paths)
        runs: list[Run] = []
        configuration, refusal, gone = np.array(start), None, 0.0
        for path in paths:
            followed = self._follow(path, configuration, terms)
            stop = followed if isinstance(followed, StopReason) else followed.stop
            if isinstance(followed, FollowedPath):
                if end is not None and stop is None and path is paths[-1]:
                    followed = self._continuation.ending(followed, np.array(end))
                if not all(is_same(row, configuration) for row in followed.configurations):
                    runs.append(self._run(path, followed, terms))
                    configuration = followed.configurations[-1]
                before += float(followed.lengths[-1])
                gone += path.metres_to(float(followed.lengths[-1]))
            if stop is not None:
                refusal = _stopped(stop, gone, metres, before / whole)
                break
        fraction = 1.0 if refusal is None else before / whole
        least = terms.tool.least_fraction
        if refusal is not None and (not runs or fraction < least):
            raise PlanRefused(_code(refusal), _too_little(refusal, fraction, least), fraction)
        if not runs:
            last = end if end is not None and is_same(end, start) else start
            standing = straight_line(self._arm.joint_names, start, last, terms.limits)
            return CartesianPath(standing, last, fraction, refusal)
        return CartesianPath(self._timed(runs, terms), tuple(configuration.tolist()), fraction, refusal)

    def _follow(self, path: ToolPath, start: Array, terms: CartesianTerms) -> FollowedPath | StopReason:
        """As far as the joints and what stands around let it."""
        followed = self._continuation.follow(path, start, terms.tool.max_step, terms.tool.jump, terms.deadline)
        if isinstance(followed, StopReason):
            return followed
        free, touching = self._free(followed, terms)
        if touching is None:
            return followed
        stop = self._touches(touching, terms.margin)
        if free < SHORTEST_PATH:
            return stop
        return self._continuation.shortened(path, followed, free, stop, terms.deadline)

    def _free(self, followed: FollowedPath, terms: CartesianTerms) -> tuple[float, Array | None]:
        """The length up to which everything keeps clear, and the configuration that does not; looked at by conservative
        advancement, so that nothing is skipped."""
        margin = terms.margin
        end, joints = float(followed.lengths[-1]), followed.configurations.shape[1]
        rows = np.linspace(0.0, end, min(MOST_ROWS, 8 * len(followed.lengths)))
        configurations = followed.curve.at(rows).value[:, :joints]
        if self._checker.touching(configurations, DEEPER * margin) is None:
            return end, None
        moved = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(configurations, axis=0)) @ self._checker.reach)))
        along, free = 0.0, 0.0
        while True:
            terms.deadline.check()
            length = float(np.interp(along, moved, rows))
            configuration = followed.curve.at(np.array([length])).value[0, :joints]
            clearance = self._checker.distance(configuration) - DEEPER * margin
            if clearance <= 0.0:
                return free, configuration
            free = length
            if along >= moved[-1]:
                return end, None
            along = min(float(moved[-1]), along + max(clearance, LEAST_LOOK * margin))

    def _run(self, path: ToolPath, followed: FollowedPath, terms: CartesianTerms) -> Run:
        tool = terms.tool.speed, terms.tool.acceleration
        end = float(followed.lengths[-1])
        marks = np.array([0.0, *(mark for mark in path.marks if FINEST < mark < end - FINEST), end])
        try:
            law = law_along(followed.curve, terms.limits, tool, marks, terms.timing, terms.deadline)
        except NoProfile as error:
            raise not_verified(error.reason) from error
        return Run(
            followed.curve,
            law,
            followed.configurations[0],
            followed.configurations[-1],
            marks[1:-1],
            lambda length, configuration: self._continuation.solver.error(path.at(length), configuration),
            np.maximum(self._checker.reach, METRES_PER_RADIAN),
        )

    def _timed(self, runs: list[Run], terms: CartesianTerms) -> JointTrajectory:
        states = self._within(states_of_runs(runs, terms.deadline), terms)
        try:
            require_short(float(states.times[-1]))
        except NoProfile as error:
            raise not_verified(error.reason) from error
        return trajectory_of(self._arm.joint_names, states)

    def _within(self, states: States, terms: CartesianTerms) -> States:
        """As fast as the joints may; slower, where they or the tool would be a little faster than they may."""
        tool = terms.tool
        even = at_limits(states, terms.limits, terms.timing is Timing.JERK_LIMITED)
        if not tool.speed and not tool.acceleration:
            return even
        states = even if even.times[-1] > states.times[-1] else states
        speed, acceleration = self._tool_peaks(states)
        asked = max(
            speed / tool.speed if tool.speed else 0.0,
            (acceleration / tool.acceleration) ** 0.5 if tool.acceleration else 0.0,
        )
        return states if asked <= 1.0 else at_speed(states, 0.999 / asked)

    def _tool_peaks(self, states: States) -> tuple[float, float]:
        """The tool's highest speed [m/s] and acceleration [m/s^2] in the middle between points, by differences."""
        rows, steps = between(states, 2), MOMENT * np.diff(states.times)
        peaks = []
        for q, v, a, h in zip(rows.positions, rows.velocities, rows.accelerations, steps.tolist(), strict=True):
            now = self._kinematics.tool(q).position
            before, after = (self._kinematics.tool(q + dt * (v + 0.5 * dt * a)).position for dt in (-h, h))
            peaks.append(
                (np.linalg.norm(after - before) / (2.0 * h), np.linalg.norm(after - 2.0 * now + before) / h**2)
            )
        speed, acceleration = np.array(peaks).max(axis=0)
        return float(speed), float(acceleration)

    def _touches(self, configuration: Array, margin: float) -> StopReason:
        pairs = self._checker.pairs_within(configuration, DEEPER * margin + 1e-9) or [("?", "?")]
        distance, objects = self._checker.distance(configuration), objects_in(pairs, self._arm.model.link_names)
        touching = near_pairs(pairs, objects, margin, None)
        why = because("plan.tool.touches", *touching, remedy("make_room"), remedy("go_around"))
        return StopReason("collision", " / ".join(pairs[0]), distance, margin, why)


def _stopped(stop: StopReason, gone: float, metres: float, fraction: float) -> Refusal:
    cause, would_do = Reason(code=stop.why.code, values=stop.why.values, causes=stop.why.causes), stop.why.remedies
    why = because("plan.tool.stopped", cause, *would_do, gone=gone, whole=metres)
    if metres <= SHORTEST_TOLD:
        why = because("plan.tool.stopped_turning", cause, *would_do, share=fraction)
    return refusal_of(why, stop.check, stop.subject, stop.value, stop.limit)


def _too_little(stop: Refusal, fraction: float, least: float) -> Refusal:
    would_do = () if stop.why is None else stop.why.remedies
    if fraction > 0.001:
        would_do = (*would_do, remedy("allow_less", fraction=math.floor(1000 * fraction) / 1000))
    why = because("plan.tool.too_little", without_remedies(stop), *would_do, fraction=fraction, least=least)
    if fraction == 0.0:
        why = because("plan.tool.not_begun", without_remedies(stop), *would_do)
    return refusal_of(why, stop.check, stop.subject, stop.value, stop.limit)


def _code(stop: Refusal) -> PlanCode:
    return PlanCode.NO_IK_SOLUTION if stop.check in ("joint limit", "singularity", "jump") else PlanCode.PLANNING_FAILED
