"""By way of several goals in the space of the joints: lines from posture to posture, corners cut within the blend."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schemas.motion import JointTrajectory
from schemas.planning import FreeMotion, Timing, WaypointGoal
from services.arm.description import Arm
from services.planner.cartesian.path_points import Run, states_of_runs
from services.planner.cartesian.tool_motions import points_of
from services.planner.collision.checker import CollisionChecker
from services.planner.collision.clearance import CLEARANCE
from services.planner.kinematics.goals import Goals
from services.planner.path.path import STRAIGHT, NoWay, Start
from services.planner.path.path_curve import RoundedLines, rounded_runs
from services.planner.path.search import Search
from services.planner.pipeline.collision_refusals import Blockade
from services.planner.pipeline.planning_context import Errand
from services.planner.pipeline.trajectory_builder import Finished, Touching
from services.planner.request.deadline import Deadline
from services.planner.request.refusals import NoPlan, no_way_around, not_verified, timed_out
from services.planner.timing.path_timing import law_along
from services.planner.timing.profile import NoProfile, straight_line
from services.planner.timing.timing import at_limits, trajectory_of

Array = NDArray[np.float64]

BLENDS = 4  # times that the blend is halved where a cut corner touches, before the arm stops at every one


class Via:
    """Ways by waypoints for one arm."""

    def __init__(
        self, arm: Arm, goals: Goals, surroundings: CollisionChecker, blockade: Blockade, search: Search
    ) -> None:
        self._arm, self._goals, self._surroundings = arm, goals, surroundings
        self._blockade, self._search = blockade, search

    def plan(self, goal: WaypointGoal, errand: Errand) -> tuple[Finished, str]:
        """Straight, or around what is in the way from one to the next, with as much blend as is free."""
        with errand.watch.phase("ik"):
            postures = self._postures(goal, errand.start, errand.deadline)
        corners, planner_id = np.array(postures), STRAIGHT
        if isinstance(errand.request.motion, FreeMotion):
            corners, planner_id = self._corners(errand.request.motion, postures, errand)
        refusal: NoPlan | None = None
        for trajectory in self._trajectories(corners, goal.blend, errand):
            try:
                return errand.finisher.finish(trajectory, errand.start, postures[-1]), planner_id
            except Touching as touching:
                refusal = self._blockade.by(touching.posture, errand.margin)
            if errand.deadline.has_passed():
                break
        raise refusal or timed_out()

    def _postures(self, goal: WaypointGoal, start: Start, deadline: Deadline) -> list[Start]:
        """The start, and for each waypoint the free posture nearest to the one before."""
        chosen = [start]
        for point in points_of(goal):
            touching: Start | None = None
            for posture in self._goals.candidates(point, chosen[-1], deadline, start):
                if self._surroundings.keeps(posture, CLEARANCE):
                    chosen.append(posture)
                    break
                touching = touching or posture
            else:
                if touching is None:
                    raise timed_out()
                raise self._blockade.goal(point, touching, chosen[-1], deadline, start)
        return chosen

    def _corners(self, motion: FreeMotion, postures: list[Start], errand: Errand) -> tuple[Array, str]:
        """The polyline by `postures`, with the corners of a way around wherever a leg is not free."""
        rows, planner_id = [np.array(postures[:1])], STRAIGHT
        for begin, end in pairwise(postures):
            leg = np.array((begin, end))
            if self._surroundings.touching(leg, errand.margin) is None:
                rows.append(leg[1:])
                continue
            try:
                with errand.watch.phase("search"):
                    way = self._search.find(
                        leg[0], leg[1:], errand.margin, motion.planner_id, motion.seed, errand.deadline, errand.watch
                    )
            except NoWay as no_way:
                raise no_way_around(no_way.why, self._blockade.line(begin, end, errand.margin)) from no_way
            rows.append(way.corners[1:])
            planner_id = way.planner_id
        return np.vstack(rows), planner_id

    def _trajectories(self, corners: Array, blend: float, errand: Errand) -> Iterator[JointTrajectory]:
        """With the blend [m], with less and less of it, at last with a stop at each corner."""
        radii = [blend * 0.5**index for index in range(BLENDS)] if blend > 0.0 else []
        for radius in [*radii, 0.0]:
            with errand.watch.phase("timing"):
                trajectory = self._trajectory(corners, errand, radius)
            yield trajectory

    def _trajectory(self, corners: Array, errand: Errand, blend: float) -> JointTrajectory:
        names, limits = self._arm.joint_names, errand.limits
        lines = rounded_runs(corners, limits.velocity, self._surroundings.reach, blend)
        try:
            if not lines:
                return straight_line(names, corners[0].tolist(), corners[-1].tolist(), limits)
            states = states_of_runs([_run(line, errand) for line in lines], errand.deadline)
            return trajectory_of(names, at_limits(states, limits, errand.request.timing is Timing.JERK_LIMITED))
        except NoProfile as error:
            raise not_verified(str(error)) from error


def _run(line: RoundedLines, errand: Errand) -> Run:
    law = law_along(line, errand.limits, (0.0, 0.0), line.marks, errand.request.timing, errand.deadline)
    return Run(line, law, line.start, line.end, line.marks[1:-1])
