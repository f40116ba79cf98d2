"""The tool path of a requested line or arc: its end, its shape between, and how far it goes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import IDENTITY, compose
from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import (
    CircularMotion,
    Goal,
    LinearMotion,
    PlanCode,
    PlanRequest,
    PoseGoal,
    WaypointGoal,
)
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.cartesian.arcs import arc_about, arc_through
from gemelo.services.planner.cartesian.cartesian_planner import CartesianPath, CartesianPlanner, CartesianTerms
from gemelo.services.planner.cartesian.tool_limits import ToolLimits, require_tool_limits
from gemelo.services.planner.cartesian.tool_path import ToolPath, polyline
from gemelo.services.planner.collision.clearance import PathChecker
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.kinematics.pose_goals import target_of
from gemelo.services.planner.kinematics.targets import ROTATION_TOLERANCE, ToolTarget, turn_between
from gemelo.services.planner.kinematics.task_space import TaskSpace
from gemelo.services.planner.path.path import Start
from gemelo.services.planner.request.deadline import NEVER, Deadline
from gemelo.services.planner.request.refusals import PlanRefused, malformed, refusal_of
from gemelo.services.planner.timing.profile import JointLimits

Array = NDArray[np.float64]

INVALID = PlanCode.INVALID_GOAL_CONSTRAINTS
# Tuning constants: chosen, where a line does not say measured or standard.
FARTHEST = 1e3  # [m] chosen: a blend beyond it is a mistake, most often in millimetres


class ToolMotions:
    """Lines and arcs of one arm's tool."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, goals: Goals, checker: PathChecker) -> None:
        self._arm, self._kinematics, self._goals = arm, kinematics, goals
        self._task_space: TaskSpace = goals.task_space
        self._planner = CartesianPlanner(arm, kinematics, checker, self._task_space.is_full)

    def plan(
        self, request: PlanRequest, start: Start, limits: JointLimits, margin: float, deadline: Deadline
    ) -> CartesianPath:
        """The timed path from `start` (n,) [rad] or [m], not yet verified, that keeps `margin` [m]; raises
        `PlanRefused`."""
        tool = _tool_limits(request.motion)
        require_tool_limits(tool)

        try:
            wanted = self._wanted(request.goal, start)
            paths, end = self._paths(request, start, wanted), wanted[-1]
            path = self._planner.plan(paths, start, end, CartesianTerms(limits, tool, margin, request.timing, deadline))
        except PlanRefused as ended:
            if tool.least_fraction == 1.0 and not deadline.has_passed():
                self._require_reachable(request.goal, start, ended.fraction, deadline)
            raise
        if path.fraction == 1.0:
            self._require_turned(request.goal, start, path.end)
            self._require_joints(path.end, end)
        return path

    def _paths(self, request: PlanRequest, start: Start, wanted: list[Start | None]) -> list[ToolPath]:
        goal, begin = request.goal, self._kinematics.tool(start)
        if isinstance(request.motion, CircularMotion):
            return [self._arc(request.motion, goal, start, begin, wanted[-1])]
        poses = [begin]
        for point, configuration in zip(points_of(goal), wanted, strict=True):
            poses.append(self._pose(point, start, poses[-1], configuration))
        return polyline(poses, goal.blend if isinstance(goal, WaypointGoal) else 0.0)

    def _arc(
        self, motion: CircularMotion, goal: Goal, start: Start, begin: FramePose, wanted: Start | None
    ) -> ToolPath:
        if isinstance(goal, WaypointGoal):
            raise malformed(INVALID, "goal", because("plan.arc.waypoints", remedy("arc_by_arc")))
        if bool(motion.interim) == bool(motion.center):
            given = "plan.arc.both" if motion.interim else "plan.arc.neither"
            raise malformed(INVALID, "interim", because(given, remedy("one_of_them")))
        end = self._pose(goal, start, begin, wanted)
        name, values = ("interim", motion.interim) if motion.interim else ("center", motion.center)
        point = self._point(name, values, goal, start)
        return ToolPath([arc_through(begin, point, end) if motion.interim else arc_about(begin, point, end)])

    def _point(self, name: str, values: Vector, goal: Goal, start: Start) -> Array:
        """In the base frame; given in the goal's."""
        if len(values) != 3:
            why = because("plan.numbers", remedy("point_in_metres"), name=name, needed=3, count=len(values))
            raise malformed(INVALID, name, why)
        frame = self._goals.frame(goal, start) if isinstance(goal, PoseGoal) else IDENTITY
        x, y, z = values
        return np.array(compose(frame, ((x, y, z), IDENTITY[1]))[0])

    def _pose(self, goal: Goal, start: Start, before: FramePose, wanted: Start | None) -> FramePose:
        """Where the tool is to be; as it was turned before, where the goal leaves that open."""
        if wanted is not None:
            return self._kinematics.tool(wanted)
        assert isinstance(goal, PoseGoal)
        target = self._target(goal, start)
        if target.rotation is not None:
            return FramePose(target.position, target.rotation)
        if target.pointing is None:
            return FramePose(target.position, before.rotation)
        turn = turn_between(before.rotation @ target.pointing.axis, target.pointing.direction)
        return FramePose(target.position, pin.exp3(turn) @ before.rotation)

    def _target(self, goal: PoseGoal, start: Start) -> ToolTarget:
        return target_of(goal, self._goals.frame(goal, start))

    def _require_reachable(self, goal: Goal, start: Start, fraction: float, deadline: Deadline) -> None:
        """Raises the better refusal of a goal that no configuration meets, wherever the path to it ends."""
        try:
            for point in points_of(goal):
                next(self._goals.candidates(point, start, deadline), None)
        except PlanRefused as better:
            raise PlanRefused(better.code, better.refusal, fraction) from better

    def _require_turned(self, goal: Goal, start: Start, end: Start) -> None:
        """An arm whose tool turns as its position has it may end turned otherwise than asked."""
        last = points_of(goal)[-1]
        if self._task_space.is_full or not isinstance(last, PoseGoal):
            return
        target = self._target(last, start)
        missing = target.misses(self._kinematics.tool(end))[1]
        if missing > max(ROTATION_TOLERANCE, target.rotation_tolerance):
            next(self._goals.candidates(last, start, NEVER), None)
            why = because("plan.tool.turned", *self._task_space.remedies, angle=missing)
            raise malformed(INVALID, "orientation", why, check="orientation")

    def _wanted(self, goal: Goal, start: Start) -> list[Start | None]:
        """The configurations of those points that are joint values, None for poses; a joint that is not named stays as
        the last of them has it, or the start."""
        wanted: list[Start | None] = []
        for point in points_of(goal):
            known = next((configuration for configuration in reversed(wanted) if configuration is not None), start)
            is_pose = isinstance(point, PoseGoal)
            wanted.append(None if is_pose else next(self._goals.candidates(point, known, NEVER)))
        return wanted

    def _require_joints(self, end: Start, wanted: Start | None) -> None:
        """Joint values are what was asked for, not only the pose of the tool that belongs to them."""
        if wanted is not None and end != wanted:
            worst = int(np.argmax(np.abs(np.subtract(end, wanted))))
            raise _other_configuration(self._arm.joints[worst], end, wanted[worst], end[worst])


def points_of(goal: Goal) -> tuple[Goal, ...]:
    """The goals to be passed in order; raises `PlanRefused` where there is none, or the blend is no length."""
    if not isinstance(goal, WaypointGoal):
        return (goal,)
    if not goal.points:
        raise malformed(INVALID, "points", because("plan.waypoints.none", remedy("give_one")))
    if not 0.0 <= goal.blend <= FARTHEST:
        would_do = remedy("blend_zero"), remedy("blend_radius")
        raise malformed(INVALID, "blend", because("plan.waypoints.blend", *would_do, value=goal.blend, most=FARTHEST))
    return goal.points


def _other_configuration(joint: Joint, end: Start, wanted: float, reached: float) -> PlanRefused:
    """The tool is where it should be, the joints are not."""
    would_do = remedy("ask_pose"), remedy("go_freely")
    figures = {"reached": reached, "wanted": wanted}
    why = because("plan.tool.configuration", *would_do, joint=joint.name, unit=joint.unit, **figures)
    refusal = refusal_of(why, "configuration", joint.name, reached, wanted, end)
    return PlanRefused(PlanCode.GOAL_VIOLATES_PATH_CONSTRAINTS, refusal)


def _tool_limits(motion: object) -> ToolLimits:
    if not isinstance(motion, LinearMotion | CircularMotion):
        return ToolLimits()
    return ToolLimits(motion.speed, motion.acceleration, motion.max_step, motion.jump_threshold, motion.least_fraction)
