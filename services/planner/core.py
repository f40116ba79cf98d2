"""The planner: a request and the present state in, a verified trajectory or a refusal out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from schemas.joints import JointState
from schemas.message import Vector
from schemas.motion import JointTrajectory
from schemas.planning import (
    FreeMotion,
    Goal,
    JointGoal,
    NamedGoal,
    PlanCode,
    PlannedPath,
    PlanRequest,
    PlanResponse,
    PointToPoint,
    PoseGoal,
    Refusal,
    Timing,
    WaypointGoal,
)
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.planner.clearance import CLEARANCE, ROUNDING, first_collision, last_free
from services.planner.goals import Goals, timed_out
from services.planner.ik import never
from services.planner.profile import JointLimits, NoProfile, joint_limits, straight_line
from services.planner.refusals import NoPlan, in_collision, malformed, scaling_refused
from services.planner.start import resolve_start
from services.planner.surroundings import Surroundings
from services.planner.verify import (
    BadTrajectory,
    require_ends,
    require_within_limits,
    sample,
)
from services.planner.world import World

Array = NDArray[np.float64]
Start = tuple[float, ...]

PATH_POINTS = 100


class GoalTouches(Exception):
    """A posture at which links are nearer than the clearance."""


class Planner:
    """Plans straight lines of the joints from rest to rest for one arm."""

    def __init__(self, arm: Arm, kinematics: Kinematics | None = None) -> None:
        self.arm = arm
        self.kinematics = kinematics or Kinematics(arm)
        self.surroundings = Surroundings(World(arm, self.kinematics))
        self._goals = Goals(arm, self.kinematics, self.surroundings)

    def set_world(self, world: World) -> None:
        """What later plans heed; a plan that is being made is held against it at its end."""
        self.surroundings.newest = world

    def plan(
        self,
        request: PlanRequest,
        present: JointState | None,
        age: float = 0.0,
        is_late: Callable[[], bool] = never,
    ) -> PlanResponse:
        """The answer; `age` [s] is how old `present` is, `is_late` says when the allowed time is over."""
        self.surroundings.begin()
        try:
            return self._plan(request, present, age, is_late)
        except NoPlan as no_plan:
            version = self.surroundings.world.version
            return PlanResponse(code=no_plan.code, refusal=no_plan.refusal, scene_version=version)

    def planned_path(self, trajectory: JointTrajectory, stamp: int) -> PlannedPath:
        """The way of the tool, for eyes; `stamp` [ns] UNIX."""
        rows = trajectory.points
        chosen = {round(index * (len(rows) - 1) / (PATH_POINTS - 1)) for index in range(PATH_POINTS)}
        points = (self.kinematics.tool(rows[index].positions).position.tolist() for index in sorted(chosen))
        return PlannedPath(stamp=stamp, frame=self.arm.base_frame, points=tuple((x, y, z) for x, y, z in points))

    def _plan(
        self, request: PlanRequest, present: JointState | None, age: float, is_late: Callable[[], bool]
    ) -> PlanResponse:
        _require_known(request)
        limits = self._limits(request)
        start = resolve_start(self.arm, request.start, present, age)
        margin = self._start_margin(start)
        refusal: NoPlan | None = None
        for goal in self._goals.candidates(request.goal, start, is_late):
            try:
                trajectory = self._to(goal, start, limits, margin)
            except GoalTouches:
                refusal = refusal or self._goal_refused(request.goal, goal, start, is_late)
            except NoPlan as no_plan:
                refusal = refusal or no_plan
            else:
                return self._success(trajectory, goal)
            if is_late():
                break
        raise refusal or timed_out()

    def _success(self, trajectory: JointTrajectory, goal: Start) -> PlanResponse:
        self._hold_against_newest(trajectory)
        return PlanResponse(
            code=PlanCode.SUCCESS,
            trajectory=trajectory,
            duration=trajectory.points[-1].time_from_start,
            tool_goal=tuple(self.kinematics.tool(goal).position.tolist()),
            scene_version=self.surroundings.world.version,
        )

    def _hold_against_newest(self, trajectory: JointTrajectory) -> None:
        """Raises `NoPlan` where the scene has changed since the plan was begun and is in its way now."""
        if self.surroundings.newest is self.surroundings.world:
            return
        world = self.surroundings.begin()
        margin = self._start_margin(trajectory.points[0].positions)
        touching = first_collision(world, sample(trajectory).positions, margin)
        if touching is not None:
            raise self._touching(
                PlanCode.PLANNING_FAILED, "in the scene as it has become meanwhile", touching, margin, (), "plan again"
            )

    def _limits(self, request: PlanRequest) -> JointLimits:
        for name in ("velocity_scaling", "acceleration_scaling"):
            value = getattr(request, name)
            if not 0.0 < value <= 1.0:
                raise scaling_refused(name, value)
        return joint_limits(self.arm, request.velocity_scaling, request.acceleration_scaling)

    def _start_margin(self, start: Start) -> float:
        """[m] to keep on the way: an arm that already stands nearer than the clearance may come away from there."""
        distance = self.surroundings.distance(start)
        if distance <= 0.0:
            raise self._touching(
                PlanCode.START_STATE_IN_COLLISION,
                "where the arm stands",
                np.array(start),
                0.0,
                (),
                self._way_out(start),
            )
        return min(CLEARANCE, 0.9 * distance)

    def _to(self, goal: Start, start: Start, limits: JointLimits, margin: float) -> JointTrajectory:
        """The timed straight line to one posture, verified; raises `GoalTouches` or `NoPlan`."""
        if self.surroundings.distance(goal) <= CLEARANCE:
            raise GoalTouches
        try:
            trajectory = straight_line(self.arm.joint_names, start, goal, limits)
            samples = sample(trajectory)
            require_ends(trajectory, start, goal)
            require_within_limits(self.arm, samples, limits)
        except (NoProfile, BadTrajectory) as error:
            raise NoPlan(
                PlanCode.PLANNING_FAILED,
                Refusal(
                    check="verification",
                    message=f"the timed trajectory did not pass its verification: {error}",
                    remedy="a larger scaling or a goal farther away; if it stays, report this as a defect",
                ),
            ) from error
        touching = first_collision(self.surroundings, samples.positions, margin)
        if touching is not None:
            raise self._way_refused(touching, margin)
        return trajectory

    def _goal_refused(self, asked: Goal, goal: Start, start: Start, is_late: Callable[[], bool]) -> NoPlan:
        """The refusal of a goal at which links touch, with the last free posture on the way, in the goal's own form."""
        last = last_free(self.surroundings, np.array(start), np.array(goal))
        values = dict(zip(self.arm.joint_names, (round(value, 4) for value in last.tolist()), strict=True))
        named = ", ".join(f"{joint.name} {values[joint.name]:g} {joint.unit}" for joint in self.arm.joints)
        match asked:
            case PoseGoal():
                nearest = self._goals.shown_point(asked, start, last, is_late)
            case JointGoal():
                nearest = tuple(values[name] for name in asked.name)
            case NamedGoal() | WaypointGoal():
                nearest = tuple(values.values())
        remedy = f"the farthest it can go on the straight way there: {named}"
        return self._touching(PlanCode.GOAL_IN_COLLISION, "at the goal", np.array(goal), CLEARANCE, nearest, remedy)

    def _way_refused(self, touching: Array, margin: float) -> NoPlan:
        named = ", ".join(self.arm.named_states)
        remedy = f"go by way of another posture, for example a named one ({named})"
        return self._touching(PlanCode.PLANNING_FAILED, "on the straight way to the goal", touching, margin, (), remedy)

    def _touching(
        self, code: PlanCode, where: str, posture: Array, margin: float, nearest: Vector, remedy: str
    ) -> NoPlan:
        """The refusal of a posture in which the plan's world touches the arm, with the names of both."""
        world = self.surroundings.world
        pairs = world.pairs_within(posture, margin + ROUNDING) or [("?", "?")]
        standing = tuple(posture.tolist())
        return in_collision(code, where, pairs, margin, nearest, remedy, standing, world.objects)

    def _way_out(self, start: Start) -> str:
        """What a person can do for an arm that touches something."""
        world = self.surroundings.world
        touched = [name for pair in world.pairs_within(start) for name in pair if name in world.objects]
        if touched:
            return (
                f"move or remove {touched[0]} (`gemelo scene remove {touched[0]}`), allow the pair, or move the arm "
                "free by hand, then `gemelo reference`"
            )
        return "move the arm free by hand, then `gemelo reference`; or check the reference: the arm may be elsewhere"


def _require_known(request: PlanRequest) -> None:
    """Raises `NoPlan` for what this planner cannot do."""
    is_known_way = isinstance(request.motion, PointToPoint) or request.motion == FreeMotion()
    if is_known_way and request.timing is Timing.JERK_LIMITED:
        return
    raise malformed(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        "motion",
        "this planner makes straight joint lines, jerk-limited",
        "leave motion and timing at their defaults",
    )
