"""Streamed targets: which are taken, and when the stream has fallen silent."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.joints import LONGEST_AHEAD, JointTargets
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import because
from gemelo.services.stepper_gateway.goals.limit_checks import SLACK, beyond
from gemelo.services.stepper_gateway.goals.rejections import invalid, invalid_joints
from gemelo.services.stepper_gateway.goals.trajectory_checks import require_known
from gemelo.services.stepper_gateway.motion.chunk import require_ahead
from gemelo.services.stepper_gateway.motion.knot_sources import KNOT_TIME, TargetKnots
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits
from gemelo.services.stepper_gateway.motion.target_tracker import TargetTracker

NEVER = -1.0e9  # [s] chosen: before every monotonic clock's beginning


class TargetStream:
    """The newest target and what tracks it."""

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        self._joints = joints
        self._tracker: TargetTracker | None = None
        self._latest = NEVER  # [s] monotonic, of the last message, taken or not, or of the last target ahead in it
        self._ahead: deque[tuple[float, dict[int, float]]] = deque()  # by [s] monotonic, when they are due
        self._is_interrupted = False
        self.target: Vector | None = None  # [rad] or [m] that waits for a stream to begin

    @property
    def is_active(self) -> bool:
        return self._tracker is not None

    @property
    def is_resting(self) -> bool:
        """True if the newest knot stands."""
        return self._tracker is None or self._tracker.knot.is_at_rest

    def checked(self, targets: JointTargets) -> dict[int, float]:
        """Column and position [rad] or [m] of every joint named; raises `GoalRejected`."""
        require_known(targets.name, self._joints)
        if not targets.name:
            raise invalid_joints(because("target.joints.none"))
        if len(targets.position) != len(targets.name):
            named, given = len(targets.name), len(targets.position)
            raise invalid(because("target.positions.count", named=named, given=given))
        if len(targets.velocity) not in (0, len(targets.name)):
            named, given = len(targets.name), len(targets.velocity)
            raise invalid(because("target.velocities.count", named=named, given=given))
        names = [joint.name for joint in self._joints]
        columns = {names.index(name): position for name, position in zip(targets.name, targets.position, strict=True)}
        for column, position in columns.items():
            joint = self._joints[column]
            if not joint.lower - SLACK <= position <= joint.upper + SLACK:
                raise invalid(beyond(joint, position))
        require_ahead(targets, self._joints)
        return columns

    def note_message(self, targets: JointTargets, now: float, silence: float) -> None:
        """They have come at `now` [s]; after an interruption only `silence` [s] makes the next ones count again."""
        if now - self._latest > silence:
            self._is_interrupted = False
        self._latest = now + max(0.0, min(targets.ahead[-1].time if targets.ahead else 0.0, LONGEST_AHEAD))

    def require_uninterrupted(self, silence: float) -> None:
        """Raises `GoalRejected` until no target has come for `silence` [s] after an interruption."""
        if self._is_interrupted:
            raise invalid(because("target.interrupted", time=silence))

    def interrupt(self) -> None:
        """What was streamed does not go on by itself."""
        self._is_interrupted = True

    def take(self, columns: dict[int, float], present: Vector) -> None:
        """The newest target [rad] or [m] by column; joints that it does not name keep theirs, or stand still."""
        base = self._tracker.target if self._tracker is not None and not self._tracker.is_braking else self.target
        target = tuple(columns.get(index, value) for index, value in enumerate(base or present))
        if self._tracker is not None:
            self._tracker.follow(target)
        else:
            self.target = target

    def plan(self, targets: JointTargets, columns: tuple[int, ...], now: float) -> None:
        """Those ahead of the newest target, which came at `now` [s]; none of the ones before counts any more."""
        rows = ((now + each.time, dict(zip(columns, each.position, strict=True))) for each in targets.ahead)
        self._ahead = deque(rows)

    def due(self, now: float) -> Iterator[dict[int, float]]:
        """The targets by column that have become due by `now` [s], once."""
        while self._ahead and self._ahead[0][0] <= now:
            yield self._ahead.popleft()[1]

    def motion(self, start: Knot) -> TargetKnots:
        """Begin to track the target that waits, from rest at `start`."""
        self._tracker = TargetTracker(Limits.of(self._joints), KNOT_TIME, start)
        if self.target is not None:
            self._tracker.follow(self.target)
        self.target = None
        return TargetKnots(self._tracker)

    def is_silent(self, now: float, silence: float) -> bool:
        """True if no message has come for `silence` [s] at `now` [s] monotonic."""
        return now - self._latest > silence

    def fall_silent(self) -> None:
        """Let the stream end at rest; a target that waits is too old."""
        self.target = None
        self._ahead.clear()
        if self._tracker is not None:
            self._tracker.brake()

    def end(self, interrupted: bool = False) -> None:
        """No more tracking: it is over, a goal takes over, or it was interrupted."""
        self._is_interrupted = self._is_interrupted or (interrupted and (self.is_active or self.target is not None))
        self.fall_silent()
        self._tracker = None
