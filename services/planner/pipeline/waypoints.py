"""Paths through several goals in joint space: lines between configurations, corners cut within the blend."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import FreeMotion, Timing, WaypointGoal
from gemelo.services.planner.cartesian.path_points import Run, states_of_runs
from gemelo.services.planner.cartesian.tool_motions import points_of
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.path.path import STRAIGHT, PathNotFound, Start
from gemelo.services.planner.path.path_curve import RoundedLines, rounded_runs
from gemelo.services.planner.path.search import Search
from gemelo.services.planner.pipeline.collision_refusals import CollisionRefusals
from gemelo.services.planner.pipeline.planning_context import PlanningContext
from gemelo.services.planner.pipeline.trajectory_builder import TrajectoryTouches, VerifiedTrajectory
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import PlanRefused, no_path_around, not_verified, timed_out
from gemelo.services.planner.timing.path_timing import law_along
from gemelo.services.planner.timing.profile import NoProfile, stop_and_go, straight_line, trajectory_of
from gemelo.services.planner.timing.timing import at_limits

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
MANY = 50  # legs from rest to rest above which all are timed at once by the compiled core; chosen: 4 ms each before
BLENDS = 4  # times that the blend is halved where a cut corner touches, before the arm stops at every one


class WaypointPlanner:
    """Paths by waypoints for one arm."""

    def __init__(
        self,
        arm: ArmDescription,
        goals: Goals,
        checker: CollisionChecker,
        collision_refusals: CollisionRefusals,
        search: Search,
    ) -> None:
        self._arm, self._goals, self._checker = arm, goals, checker
        self._collision_refusals, self._search = collision_refusals, search

    def plan(self, goal: WaypointGoal, context: PlanningContext) -> tuple[VerifiedTrajectory, str]:
        """Straight, or around what is in the way from one to the next, with as much blend as is free."""
        with context.watch.phase("ik"):
            configurations = self._configurations(goal, context.start, context.deadline)
        corners, planner_id = np.array(configurations), STRAIGHT
        if isinstance(context.request.motion, FreeMotion):
            corners, planner_id = self._corners(context.request.motion, configurations, context)
        refusal: PlanRefused | None = None
        for trajectory in self._trajectories(corners, goal.blend, context):
            try:
                return context.builder.verified(trajectory, context.start, configurations[-1]), planner_id
            except TrajectoryTouches as touching:
                refusal = self._collision_refusals.waypoints(touching.configuration, context.margin)
            if context.deadline.has_passed():
                break
        raise refusal or timed_out()

    def _configurations(self, goal: WaypointGoal, start: Start, deadline: Deadline) -> list[Start]:
        """The start, and for each waypoint the free configuration nearest to the one before."""
        chosen = [start]
        for point in points_of(goal):
            touching: Start | None = None
            for configuration in self._goals.candidates(point, chosen[-1], deadline, start):
                if self._checker.keeps(configuration, self._checker.clearance):
                    chosen.append(configuration)
                    break
                touching = touching or configuration
            else:
                if touching is None:
                    raise timed_out()
                raise self._collision_refusals.goal(point, touching, chosen[-1], deadline, start)
        return chosen

    def _corners(self, motion: FreeMotion, configurations: list[Start], context: PlanningContext) -> tuple[Array, str]:
        """The polyline by `configurations`, with the corners of a path around wherever a leg is not free."""
        rows, planner_id = [np.array(configurations[:1])], STRAIGHT
        for begin, end in pairwise(configurations):
            leg = np.array((begin, end))
            touching = self._checker.touching(leg, context.margin)
            if touching is None:
                rows.append(leg[1:])
                continue
            try:
                with context.watch.phase("search"):
                    path = self._search.find(
                        leg[0],
                        leg[1:],
                        context.margin,
                        motion.planner_id,
                        motion.seed,
                        context.deadline,
                        context.watch,
                        motion.attempts,
                    )
            except PathNotFound as not_found:
                deadline, margin = context.deadline, context.margin
                blocked = self._collision_refusals.line(begin, end, margin, deadline, touching)
                raise no_path_around(not_found.reason, blocked) from not_found
            rows.append(path.corners[1:])
            planner_id = path.planner_id
        return np.vstack(rows), planner_id

    def _trajectories(self, corners: Array, blend: float, context: PlanningContext) -> Iterator[JointTrajectory]:
        """With the blend [m], with less and less of it, at last with a stop at each corner."""
        radii = [blend * 0.5**index for index in range(BLENDS)] if blend > 0.0 else []
        for radius in [*radii, 0.0]:
            with context.watch.phase("timing"):
                trajectory = self._trajectory(corners, context, radius)
            yield trajectory

    def _trajectory(self, corners: Array, context: PlanningContext, blend: float) -> JointTrajectory:
        names, limits = self._arm.joint_names, context.limits
        is_jerk_limited = context.request.timing is Timing.JERK_LIMITED
        lines = rounded_runs(corners, limits.velocity, self._checker.reach, blend)
        try:
            if not lines:
                return straight_line(names, corners[0].tolist(), corners[-1].tolist(), limits)
            if len(lines) > MANY and blend == 0.0 and is_jerk_limited:
                stops = np.vstack((lines[0].start, *(line.end for line in lines)))
                return trajectory_of(names, stop_and_go(stops, limits))
            states = states_of_runs([_run(line, context) for line in lines], context.deadline)
            return trajectory_of(names, at_limits(states, limits, is_jerk_limited))
        except NoProfile as error:
            raise not_verified(error.reason) from error


def _run(line: RoundedLines, context: PlanningContext) -> Run:
    law = law_along(line, context.limits, (0.0, 0.0), line.marks, context.request.timing, context.deadline)
    return Run(line, law, line.start, line.end, line.marks[1:-1])
