"""A line of the tool the plain way: poses on it, the nearest posture for each, a spline through them timed by toppra.

As MoveIt's `computeCartesianPath` and its time-optimal parametrisation go about it: what is between the poses is not
looked at, the result is not verified, and its jerk is whatever it is.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from schemas.planning import PlanRequest, PoseGoal
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.bench.path_bound import least_time
from services.planner.collision.world import World
from services.planner.kinematics.ik import InverseKinematics
from services.planner.kinematics.targets import Target
from services.planner.request.deadline import NEVER
from services.planner.timing.profile import joint_limits

Array = NDArray[np.float64]

STEP = 0.005  # [m] between two poses
JUMP = 0.5  # [rad], [m] that no joint may move between them
FULL = 6  # joints with which the tool keeps its orientation


class PlainLines:
    """For one arm without a scene."""

    def __init__(self, arm: Arm) -> None:
        self._kinematics = Kinematics(arm)
        self._world = World(arm, self._kinematics)
        self._solver = InverseKinematics(arm, self._kinematics)
        self._limits = joint_limits(arm)
        self._is_full = len(arm.joints) >= FULL

    def solving_ms(self, request: PlanRequest) -> float:
        """For a request with a start and a position in the base frame, as far as the line goes."""
        began = time.perf_counter()
        rows = self.rows(request)
        if len(rows) > 1:
            least_time(rows, self._limits)
        return (time.perf_counter() - began) * 1e3

    def rows(self, request: PlanRequest) -> Array:
        """(m, n) postures from the start on."""
        if request.start is None or not isinstance(request.goal, PoseGoal):
            raise ValueError("a plain line is asked for with a start and a tool position")
        rows = [np.array(request.start.position)]
        pose = self._kinematics.tool(rows[0])
        way = np.array(request.goal.position) - pose.position
        for share in np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(way) / STEP))[1:].tolist():
            target = Target(pose.position + share * way, pose.rotation if self._is_full else None)
            posture = next(self._solver.solutions(target, rows[-1], NEVER), None)
            if posture is None or np.abs(posture - rows[-1]).max() > JUMP or self._world.distance(posture) <= 0.0:
                break
            rows.append(posture)
        return np.array(rows)
