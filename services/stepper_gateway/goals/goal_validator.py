"""A goal held against the arm: accepted with a path to follow, or refused with joint, value, limit and remedy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.reasons import because, remedy
from gemelo.services.stepper_gateway.goals.goal_checks import GoalChecks
from gemelo.services.stepper_gateway.goals.limit_checks import within
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected, invalid
from gemelo.services.stepper_gateway.goals.scene_versions import PlannedIn
from gemelo.services.stepper_gateway.goals.trajectory_checks import Tolerances, time_tolerance, tolerances
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits, whole_steps
from gemelo.services.stepper_gateway.motion.paths import TimedPath, join_path, profile
from gemelo.services.stepper_gateway.parameters import GatewayParameters

SAME_VELOCITY = 1e-9  # [rad/s] or [m/s] chosen: rounding of a velocity that was computed
MAX_DELAY = 60.0  # [s] that a trajectory's stamp may lie in the future; chosen: more is a wrong clock


@dataclass(frozen=True)
class ValidatedGoal:
    """A goal whose form is right, in the arm's joint order."""

    trajectory: JointTrajectory
    path_tolerance: Tolerances
    goal_tolerance: Tolerances
    time_tolerance: float | None  # [s]
    planned_in: PlannedIn
    checks: GoalChecks

    @property
    def target(self) -> Vector:
        """[rad] or [m] where the arm is to end."""
        return self.trajectory.points[-1].positions

    def with_more_time(self, seconds: float) -> ValidatedGoal:
        """The same, which may end so much later [s]."""
        late = self.time_tolerance
        return self if late is None or not seconds else replace(self, time_tolerance=late + seconds)


@dataclass(frozen=True)
class MotionStart:
    """Where the arm is for the sake of a new path: its next knot to be decided, and the range it sweeps meanwhile."""

    start: Knot
    lowest: Vector
    highest: Vector
    is_sent: bool = False  # the next knot follows one that was sent, perhaps between two whole steps

    @classmethod
    def at_rest(cls, position: Vector) -> MotionStart:
        """The arm rests at `position` [rad] or [m]."""
        return cls(Knot.at_rest(position), position, position)

    def joined(self, other: MotionStart) -> MotionStart:
        """From here, having swept the other's range too."""
        lowest = tuple(map(min, self.lowest, other.lowest))
        return MotionStart(self.start, lowest, tuple(map(max, self.highest, other.highest)), self.is_sent)


class GoalValidator:
    """Validation for one arm."""

    def __init__(self, joints: tuple[Joint, ...], tick_hz: int) -> None:
        self._joints = joints
        self._limits = Limits.of(joints)
        self._tick_hz = tick_hz
        self._prepared: GoalChecks | None = None

    def prepare(
        self, goal: FollowJointTrajectoryGoal, start: Knot | None, parameters: GatewayParameters
    ) -> Iterator[None]:
        """Does ahead, in pieces, what `check` and `path` find done then; `start` is where the arm is, if it is known.

        Whatever they find, done or not, they decide the same.
        """
        checks = GoalChecks(goal, self._joints, parameters, self._tick_hz, None if start is None else start.position)
        yield from checks.pieces(start)
        self._prepared = checks

    def check(
        self, goal: FollowJointTrajectoryGoal, now: int, parameters: GatewayParameters, hold: Vector | None = None
    ) -> ValidatedGoal:
        """What does not depend on where the arm is, but for the joints that the goal does not name: they stay at `hold`
        (n,) [rad] or [m]. `now` in ns UNIX; raises `GoalRejected`."""
        path_bounds, end_bounds = tolerances(goal, self._joints, parameters.tolerance_factor)
        late = time_tolerance(goal, parameters.goal_time_tolerance)
        checks = self._checks_of(goal, parameters, hold)
        trajectory = checks.form.result()
        _require_time_ahead(trajectory, now)
        checks.points.result()
        return ValidatedGoal(trajectory, path_bounds, end_bounds, late, PlannedIn.of(goal), checks)

    def _checks_of(
        self, goal: FollowJointTrajectoryGoal, parameters: GatewayParameters, hold: Vector | None
    ) -> GoalChecks:
        prepared, self._prepared = self._prepared, None
        if prepared is not None and prepared.are_of(goal, parameters, hold):
            return prepared
        return GoalChecks(goal, self._joints, parameters, self._tick_hz, hold)

    def path(
        self, goal: ValidatedGoal, motion_start: MotionStart, now: int, parameters: GatewayParameters
    ) -> TimedPath:
        """The path from where the arm is, all of it within the limits; raises `GoalRejected`."""
        trajectory = goal.trajectory
        offset = max(0.0, (now - trajectory.stamp) * 1e-9) if trajectory.stamp else 0.0
        start = motion_start.start
        checks = (
            goal.checks
            if goal.checks.parameters == parameters
            else self._checks_of(goal.checks.goal, parameters, goal.checks.hold)
        )
        if checks.is_single_point:
            return self._single_point(trajectory.points[0], start, offset)
        path = checks.path_from(start, offset)
        first = path.at(0.0)
        if self._is_same(motion_start, first):
            return path
        self._require_near(first, motion_start, parameters)
        joined = join_path(start, path, self._limits, lambda knot: within(knot, self._joints))
        if joined is None:
            raise invalid(because("goal.start.no_way_onto", remedy("wait_for_rest")))
        return joined

    def _single_point(self, point: TrajectoryPoint, start: Knot, offset: float) -> TimedPath:
        """Straight there in exactly the time given, jerk-limited: a goal without a planner."""
        target = Knot.at_rest(point.positions)
        fastest = profile(start, target, self._limits)
        if fastest is None:
            raise invalid(because("goal.start.no_way_to_point", remedy("wait_for_rest")))
        wanted = point.time_from_start - offset
        if fastest.duration > wanted + 1e-6 and wanted > 0.0:
            later = remedy("later_time")
            raise invalid(because("goal.time.too_short", later, time=wanted, least=fastest.duration))
        # Ruckig cannot stretch every motion to every duration; being early by a little is within the goal.
        path = profile(start, target, self._limits, max(wanted, 0.0)) or fastest
        if not all(within(path.at(path.duration * i / 200), self._joints) for i in range(201)):
            raise invalid(because("goal.start.leaves_limits", remedy("wait_for_rest")))
        return path

    def _is_same(self, motion_start: MotionStart, first: Knot) -> bool:
        """True if the path begins where the arm is: on the same whole steps, or to the wire's resolution."""
        start = motion_start.start
        rows = list(zip(self._joints, start.position, first.position, strict=True))
        if start.is_at_rest and first.is_at_rest and not motion_start.is_sent:
            return all(whole_steps(j.steps.to_q8(a)) == whole_steps(j.steps.to_q8(b)) for j, a, b in rows)
        if any(abs(a - b) > SAME_VELOCITY for a, b in zip(start.velocity, first.velocity, strict=True)):
            return False
        return all(abs(a - b) * joint.steps.per_unit <= 1.0 / 256.0 for joint, a, b in rows)

    def _require_near(self, first: Knot, motion_start: MotionStart, parameters: GatewayParameters) -> None:
        rows = zip(self._joints, first.position, motion_start.lowest, motion_start.highest, strict=True)
        for joint, position, lowest, highest in rows:
            linear = joint.unit == "m"
            tolerance = parameters.start_tolerance_linear if linear else parameters.start_tolerance
            if not lowest - tolerance <= position <= highest + tolerance:
                there = {"present": lowest} if lowest == highest else {"lowest": lowest, "highest": highest}
                apart = {"start": position, "distance": max(lowest - position, position - highest)}
                raise invalid(
                    because(
                        "goal.start.elsewhere" if lowest == highest else "goal.start.moving_elsewhere",
                        remedy("plan_from_here"),
                        joint=joint.name,
                        unit=joint.unit,
                        tolerance=tolerance,
                        **there,
                        **apart,
                    )
                )


def _require_time_ahead(trajectory: JointTrajectory, now: int) -> None:
    if trajectory.stamp == 0:
        return
    end = trajectory.stamp * 1e-9 + trajectory.points[-1].time_from_start
    if end < now * 1e-9:
        raise GoalRejected(
            FollowErrorCode.OLD_HEADER_TIMESTAMP,
            because("goal.time.past", remedy("start_now"), time=now * 1e-9 - end),
        )
    delay = trajectory.stamp * 1e-9 - now * 1e-9
    if delay > MAX_DELAY:
        raise invalid(because("goal.time.far_ahead", remedy("send_later"), time=delay, limit=MAX_DELAY))
