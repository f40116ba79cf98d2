"""The planner: a request and the present state in, a verified trajectory or a refusal out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import MOST_POINTS, JointTrajectory
from gemelo.schemas.planning import (
    MOST_ATTEMPTS,
    CircularMotion,
    FreeMotion,
    LinearMotion,
    PlanCode,
    PlannedPath,
    PlanRequest,
    PlanResponse,
    WaypointGoal,
)
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.robot import LEAST_CLEARANCE, MOST_CLEARANCE
from gemelo.services.planner.cartesian.tool_motions import ToolMotions
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.kinematics.descent import tool_position
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.path.path import STRAIGHT, PathNotFound, Start
from gemelo.services.planner.path.search import Search, require_known
from gemelo.services.planner.pipeline.collision_refusals import CollisionRefusals
from gemelo.services.planner.pipeline.planning_context import PlanningContext
from gemelo.services.planner.pipeline.trajectory_builder import TrajectoryBuilder, TrajectoryTouches, VerifiedTrajectory
from gemelo.services.planner.pipeline.waypoints import WaypointPlanner
from gemelo.services.planner.request.deadline import NEVER, CancelFlag, Deadline, DeadlinePassed, Stopwatch, endless
from gemelo.services.planner.request.refusals import (
    LEAST_SCALING,
    PlanRefused,
    SearchFailure,
    clearance_refused,
    malformed,
    no_path_around,
    scaling_refused,
    timed_out,
    too_long,
)
from gemelo.services.planner.request.start_state import resolve_start
from gemelo.services.planner.timing.profile import JointLimits, joint_limits
from gemelo.services.planner.verification.verify import sample

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
PATH_POINTS = 100  # chosen: enough to draw a path smoothly, and small as a message
MOST_GOALS = 8  # configurations of one goal that are tried; chosen: an arm of six joints mostly has eight
PLANNED = 0.93  # of the time allowed is for the plan, the rest for its answer: what is in the way, where there is none
LATEST = 0.06  # of the time for the plan, beyond it: then every question about collisions ends the plan
LONGEST = 120.0  # [s] that may be allowed; chosen: nobody waits longer, and a worker is busy for all of it
ATTEMPTS = 3  # searches, where the finished path fails its verification; chosen: the next seed mostly succeeds
NEAR_START = 0.9  # of the distance at the start is kept on the way, where that is less than the clearance
TOOL = "tool"  # the planner_id of lines and arcs of the tool


class Planner:
    """Plans from rest to rest for one arm: the straight line of the joints, or a path around."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics | None = None) -> None:
        self.arm = arm
        self.kinematics = kinematics or Kinematics(arm)
        self.checker = CollisionChecker(World(arm, self.kinematics))
        self._goals = Goals(arm, self.kinematics, self.checker)
        self._tool_position = tool_position(arm, self.kinematics)
        self._collision_refusals = CollisionRefusals(arm, self._goals, self.checker)
        self._tool_motions = ToolMotions(arm, self.kinematics, self._goals, self.checker)
        self._search = Search(arm, self.checker)
        self._waypoints = WaypointPlanner(arm, self._goals, self.checker, self._collision_refusals, self._search)

    def set_world(self, world: World) -> None:
        """Sets the scene of later plans; a plan that is being made is held against it at its end."""
        self.checker.newest = world

    def prepare(self) -> None:
        """Does now what the first plan in the newest world would wait for: seconds, in which the links are filled with
        spheres, and a large mesh with distances."""
        self.checker.begin()
        self.checker.native(self.checker.clearance)
        self._search.prepare()

    def plan(
        self,
        request: PlanRequest,
        present: JointState | None,
        age: float = 0.0,
        clock: Callable[[], float] = endless,
        cancel: CancelFlag | None = None,
        watch: Stopwatch | None = None,
    ) -> PlanResponse:
        """The answer; `age` [s] is how old `present` is, `clock` [s] says how the allowed time goes by.

        Another thread may set `cancel`, and see on `watch` what the plan is at.
        """
        self.checker.begin()
        watch, deadline = watch or Stopwatch(clock), Deadline(clock, PLANNED * request.allowed_time, clock(), cancel)
        self.checker.deadline = self.checker.world.deadline = deadline.extended(LATEST)
        try:
            return self._plan(request, present, age, deadline, watch)
        except PlanRefused as refused:
            return PlanResponse(
                code=refused.code,
                refusal=refused.refusal,
                fraction=refused.fraction,
                times=watch.times,
                scene_version=self.checker.world.scene.version,
                scene_epoch=self.checker.world.scene.epoch,
            )
        finally:
            self.checker.deadline = self.checker.world.deadline = NEVER

    def planned_path(self, trajectory: JointTrajectory, stamp: int) -> PlannedPath:
        """The path of the tool, for display; `stamp` [ns] UNIX."""
        rows = trajectory.points
        chosen = {round(index * (len(rows) - 1) / (PATH_POINTS - 1)) for index in range(PATH_POINTS)}
        shown = [rows[index] for index in sorted(chosen)]
        return PlannedPath(
            stamp=stamp,
            frame=self.arm.base_frame,
            points=tuple(self._tool_position(row.positions) for row in shown),
            name=trajectory.joint_names,
            positions=tuple(row.positions for row in shown),
            times=tuple(row.time_from_start for row in shown),
        )

    def _plan(
        self, request: PlanRequest, present: JointState | None, age: float, deadline: Deadline, watch: Stopwatch
    ) -> PlanResponse:
        _require_known(request)
        limits = self._limits(request)
        self.checker.clearance = self._clearance(request)
        start = resolve_start(self.arm, request.start, present, age)
        margin = self._start_margin(start, deadline)
        builder = TrajectoryBuilder(self.arm, self.checker, request, limits, margin, watch, self.checker.deadline)
        context = PlanningContext(request, start, limits, margin, builder, deadline, watch)
        fraction, stopped_by = 1.0, None
        if isinstance(request.motion, LinearMotion | CircularMotion):
            with watch.phase("search"):
                path = self._tool_motions.plan(request, start, limits, margin, deadline)
            finished, planner_id = self._verified(path.trajectory, path.end, context), TOOL
            fraction, stopped_by = path.fraction, path.stopped_by
        elif isinstance(request.goal, WaypointGoal):
            finished, planner_id = self._waypoints.plan(request.goal, context)
        else:
            finished, planner_id = self._found(context)
        if len(finished.trajectory.points) > MOST_POINTS:
            raise too_long(len(finished.trajectory.points))
        self._hold_against_newest(finished.trajectory, deadline)
        return PlanResponse(
            code=PlanCode.SUCCESS,
            trajectory=finished.trajectory,
            duration=finished.trajectory.points[-1].time_from_start,
            tool_goal=self._tool_position(finished.trajectory.points[-1].positions),
            margins=finished.margins,
            slowed=finished.slowed,
            planner_id=planner_id,
            fraction=fraction,
            stopped_by=stopped_by,
            times=watch.times,
            scene_version=self.checker.world.scene.version,
            scene_epoch=self.checker.world.scene.epoch,
        )

    def _verified(self, trajectory: JointTrajectory, end: Start, context: PlanningContext) -> VerifiedTrajectory:
        try:
            return context.builder.verified(trajectory, context.start, end)
        except TrajectoryTouches as touching:
            raise self._collision_refusals.path(touching.configuration, context.margin) from touching

    def _found(self, context: PlanningContext) -> tuple[VerifiedTrajectory, str]:
        """The straight line to the first configuration to which there is one, or else a path around to any."""
        touching: list[Start] = []
        goals: list[Start] = []
        blocked: list[Array] = []
        for goal in chain(self._configurations(context), self._other_ways(goals, context)):
            if not self.checker.keeps(goal, self.checker.clearance):
                touching.append(goal)
            else:
                try:
                    return context.builder.line(context.start, goal), STRAIGHT
                except TrajectoryTouches as line:
                    goals.append(goal)
                    blocked.append(line.configuration)
            if context.deadline.has_passed() or len(goals) == MOST_GOALS:
                break
        request = context.request
        if goals:
            if isinstance(request.motion, FreeMotion):
                return self._around(request.motion, np.array(goals), blocked[0], context)
            raise self._collision_refusals.line(context.start, goals[0], context.margin, context.deadline, blocked[0])
        if touching:
            raise self._collision_refusals.goal(request.goal, touching[0], context.start, context.deadline)
        raise timed_out()

    def _configurations(self, context: PlanningContext) -> Iterator[Start]:
        """The goal's configurations, nearest first, on the clock of the kinematics."""
        with context.watch.phase("ik"):
            configurations = self._goals.candidates(context.request.goal, context.start, context.deadline)
        while True:
            with context.watch.phase("ik"):
                configuration = next(configurations, None)
            if configuration is None:
                break
            yield configuration

    def _other_ways(self, goals: list[Start], context: PlanningContext) -> Iterator[Start]:
        """Where any way will do, the goals found by then, with joints without limits turned the other way round."""
        if isinstance(context.request.motion, FreeMotion):
            yield from self._goals.other_ways_round(goals, context.start)

    def _around(
        self, motion: FreeMotion, goals: Array, blocked: Array, context: PlanningContext
    ) -> tuple[VerifiedTrajectory, str]:
        """A path around what is on the straight one to the first goal, where it touches in `blocked` (n,); another one,
        where the finished trajectory touches."""
        start, margin = context.start, context.margin
        refusal: PlanRefused | None = None
        for attempt in range(ATTEMPTS):
            try:
                with context.watch.phase("search"):
                    path = self._search.find(
                        np.array(start),
                        goals,
                        margin,
                        motion.planner_id,
                        motion.seed + attempt,
                        context.deadline,
                        context.watch,
                        motion.attempts,
                        are_lines_blocked=True,
                    )
                return context.builder.path(path), path.planner_id
            except (PathNotFound, DeadlinePassed) as not_found:
                reason = not_found.reason if isinstance(not_found, PathNotFound) else SearchFailure.TIMED_OUT
                line = self._collision_refusals.line(start, tuple(goals[0].tolist()), margin, context.deadline, blocked)
                raise no_path_around(reason, line) from not_found
            except TrajectoryTouches as touching:
                refusal = self._collision_refusals.path(touching.configuration, margin)
            if context.deadline.has_passed():
                break
        raise refusal or timed_out()

    def _hold_against_newest(self, trajectory: JointTrajectory, deadline: Deadline) -> None:
        """Raises `PlanRefused` where the scene has changed since the plan was begun and is in its way now."""
        if self.checker.newest is self.checker.world:
            return
        self.checker.begin()
        margin = self._start_margin(trajectory.points[0].positions, deadline)
        touching = self.checker.touching(sample(trajectory).positions, margin)
        if touching is not None:
            code, where = PlanCode.PLANNING_FAILED, "plan.collision.meanwhile"
            raise self._collision_refusals.refusal(code, where, touching, margin, (), (remedy("plan_again"),))

    def _limits(self, request: PlanRequest) -> JointLimits:
        for name in ("velocity_scaling", "acceleration_scaling"):
            value = getattr(request, name)
            if not LEAST_SCALING <= value <= 1.0:
                raise scaling_refused(name, value)
        return joint_limits(self.arm, request.velocity_scaling, request.acceleration_scaling)

    def _clearance(self, request: PlanRequest) -> float:
        """[m] that this plan keeps free; raises `PlanRefused` for what no plan may keep."""
        asked = self.arm.clearance if request.clearance is None else request.clearance
        if not LEAST_CLEARANCE <= asked <= MOST_CLEARANCE:
            raise clearance_refused(asked)
        return asked

    def _start_margin(self, start: Start, deadline: Deadline) -> float:
        """[m] to keep on the way: an arm that already stands nearer than the clearance may come away from there."""
        clearance = self.checker.clearance
        if self.checker.keeps(start, clearance / NEAR_START):
            return clearance
        distance = self.checker.distance(start)
        if distance <= 0.0:
            raise self._collision_refusals.start(start, deadline)
        return min(clearance, NEAR_START * distance)


def _require_known(request: PlanRequest) -> None:
    """Raises `PlanRefused` for what this planner cannot do."""
    if not 0.0 < request.allowed_time <= LONGEST:
        would_do = remedy("default_time", time=1.0)
        why = because("plan.allowed_time", would_do, value=request.allowed_time, most=LONGEST)
        raise malformed(PlanCode.INVALID_GOAL_CONSTRAINTS, "allowed_time", why)
    if isinstance(request.motion, FreeMotion):
        require_known(request.motion.planner_id)
        if not 1 <= request.motion.attempts <= MOST_ATTEMPTS:
            would_do = remedy("default_attempts")
            why = because("plan.attempts", would_do, value=request.motion.attempts, most=MOST_ATTEMPTS)
            raise malformed(PlanCode.INVALID_GOAL_CONSTRAINTS, "attempts", why)
