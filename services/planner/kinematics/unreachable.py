"""Refusals of pose goals that no configuration meets, with the nearest pose that one does."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, inverse
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import PlanCode, PoseGoal
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.collision.clearance import DistanceChecker, last_free
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.pose_goals import as_goal
from gemelo.services.planner.kinematics.targets import POSITION_TOLERANCE, ToolTarget
from gemelo.services.planner.kinematics.task_space import TaskSpace
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import PlanRefused, out_of_reach, refusal_of

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
PRINTED = 1e-4  # [m] to which the nearest point is rounded that a person is told
NEAREST_TRIED = 6  # configurations; chosen: the nearest ones are alike beyond these
LIGHT = 0.002  # [m/rad] a turn that must not cost position; chosen: a hundredth of the usual weight
FORGIVABLE = math.radians(2.0)  # below which a tolerance is what a person may have wanted


class UnreachableRefusals:
    """Refusals of pose goals for one arm."""

    def __init__(
        self,
        arm: ArmDescription,
        kinematics: Kinematics,
        ik: InverseKinematics,
        able: TaskSpace,
        collisions: DistanceChecker,
    ) -> None:
        self._arm, self._kinematics, self._ik = arm, kinematics, ik
        self._task_space, self._collisions = able, collisions
        self._carrying = _carrying(arm)

    def refusal(self, goal: PoseGoal, target: ToolTarget, frame: Rigid, near: Array, deadline: Deadline) -> PlanRefused:
        """The refusal for a position out of reach, or for an orientation that the arm cannot have there, with the
        nearest pose; `near` (n,) [rad] or [m] is the start, `frame` the goal's frame in the base."""
        place = ToolTarget(target.position, position_tolerance=target.position_tolerance)
        best = self._nearest_free(place, near, deadline)
        pose = self._kinematics.tool(best)
        if not self._task_space.allows(target):
            return self._tilt_refused(goal, target, frame, self._nearest_turned(target, place, best, near, deadline))
        if target.misses(pose)[0] <= max(POSITION_TOLERANCE, target.position_tolerance) and target.has_turn:
            return self._turn_refused(goal, target, frame, self._nearest_turned(target, place, best, near, deadline))
        shown = self.shown(goal, best, frame, deadline)
        return out_of_reach(self._arm, target.position.tolist(), pose.position.tolist(), shown, self._held(best))

    def shown(self, goal: PoseGoal, configuration: Array, frame: Rigid, deadline: Deadline) -> Vector:
        """The tool's pose in `configuration` (n,) [rad] or [m], in the goal's form and in `frame`: position (3,) [m],
        then the orientation or the direction, if the goal has one. A position alone is rounded to a point that can be
        reached."""
        pose = self._kinematics.tool(configuration)
        if goal.orientation or goal.tool_axis:
            return as_goal(goal, pose, frame)
        return self._printable(pose.position, configuration, frame, deadline)

    def _nearest_free(self, target: ToolTarget, near: Array, deadline: Deadline) -> Array:
        """The best configuration; one that touches is drawn back towards the start until it does not."""
        free: list[Array] = []
        for configuration in self._ik.nearest(target, near, deadline)[:NEAREST_TRIED]:
            free.append(self._drawn_back(near, configuration))
            if free[-1] is configuration:  # what comes after it is no nearer
                break
        return min(free, key=lambda q: target.misses(self._kinematics.tool(q))[0])

    def _drawn_back(self, near: Array, configuration: Array) -> Array:
        if self._collisions.distance(configuration) > self._collisions.clearance:
            return configuration
        return last_free(self._collisions, near, configuration)

    def _nearest_turned(
        self, target: ToolTarget, place: ToolTarget, fallback: Array, near: Array, deadline: Deadline
    ) -> Array:
        """At the place, the configuration that turns the tool as nearly as it can be, and touches nothing."""
        light = target._replace(metres_per_radian=LIGHT, rotation_tolerance=0.0)
        turned: list[Array] = []
        for configuration in self._ik.nearest(place, near, deadline)[:NEAREST_TRIED]:
            attempt = self._ik.descend(place, self._ik.descend(light, configuration).positions)
            if attempt.is_solution and self._collisions.distance(attempt.positions) > self._collisions.clearance:
                turned.append(attempt.positions)
        return min(turned, key=lambda q: target.misses(self._kinematics.tool(q))[1], default=fallback)

    def _tilt_refused(self, goal: PoseGoal, target: ToolTarget, frame: Rigid, best: Array) -> PlanRefused:
        missing = self._task_space.missing_tilt(target)
        able, nearest = self._task_space, as_goal(goal, self._kinematics.tool(best), frame)
        why = because("plan.orientation.impossible", able.why, *able.remedies, missing=missing)
        refusal = refusal_of(why, "orientation", able.turning, missing, target.rotation_tolerance, nearest)
        return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal)

    def _turn_refused(self, goal: PoseGoal, target: ToolTarget, frame: Rigid, best: Array) -> PlanRefused:
        pose = self._kinematics.tool(best)
        missing = target.misses(pose)[1]
        nearest, what = as_goal(goal, pose, frame), "direction" if goal.tool_axis else "orientation"
        would_do = [remedy("nearest_direction" if goal.tool_axis else "nearest_orientation", turned=nearest[3:])]
        if not self._task_space.is_full:
            would_do += self._task_space.remedies
        if missing < FORGIVABLE:
            would_do.append(remedy("allow_turn", tolerance=math.ceil(missing * 1e4) / 1e4))
        held = self._held(best)
        code = "plan.orientation.held" if held else "plan.orientation"
        if not held and not self._task_space.is_full:
            code, held = "plan.orientation.unable", [self._task_space.why]
        why = because(code, *held, *would_do, tool=self._arm.tool_frame, missing=missing)
        refusal = refusal_of(why, "orientation", what, missing, target.rotation_tolerance, nearest)
        return PlanRefused(PlanCode.NO_IK_SOLUTION, refusal)

    def _printable(self, point: Array, configuration: Array, frame: Rigid, deadline: Deadline) -> Vector:
        """The nearest point to `point` that has few decimals in the goal's frame and can be reached like that."""
        a, b, c = point.tolist()
        local = np.array(compose(inverse(frame), ((a, b, c), IDENTITY[1]))[0])
        corners = [np.floor(local / PRINTED) + np.array(corner) for corner in product((0, 1), repeat=3)]
        for corner in sorted(corners, key=lambda corner: float(np.linalg.norm(corner * PRINTED - local))):
            x, y, z = (round(value, 4) for value in (corner * PRINTED).tolist())
            back = np.array(compose(frame, ((x, y, z), IDENTITY[1]))[0])
            attempt = self._ik.descend(ToolTarget(back), configuration)
            if deadline.has_passed() or (
                attempt.is_solution and self._collisions.distance(attempt.positions) > self._collisions.clearance
            ):
                return (x, y, z)
        return tuple(local.tolist())

    def _held(self, configuration: Array) -> list[Reason]:
        """The joints between base and tool that stand at a limit."""
        held = []
        for joint, value in zip(self._arm.joints, configuration.tolist(), strict=True):
            if joint.name not in self._carrying:
                continue
            for side, limit in (("lower", joint.lower), ("upper", joint.upper)):
                if abs(value - limit) < 1e-9:
                    held.append(because("plan.held", joint=joint.name, side=side, limit=limit, unit=joint.unit))
        return held


def _carrying(arm: ArmDescription) -> frozenset[str]:
    """The joints whose motion moves the tool against the base; a gripper's jaw beside the tool does not."""
    above = {joint.child: joint for joint in arm.model.joints}

    def leading(link: str) -> set[str]:
        names = set()
        while link in above:
            joint = above[link]
            names.add(joint.mimic.joint if joint.mimic is not None else joint.name)
            link = joint.parent
        return names

    return frozenset(leading(arm.tool_frame) ^ leading(arm.base_frame))
