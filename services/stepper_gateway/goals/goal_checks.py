"""All checks of one goal that cost more the longer it is: each is done once, in pieces where the loop has the time.

Where the arm is decides only about the way to the first point; the rest is the same whenever the goal is accepted.
"""

from __future__ import annotations

from collections.abc import Iterator

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.services.stepper_gateway.goals.limit_checks import Samples, path_within, points_within
from gemelo.services.stepper_gateway.goals.pieces import PIECE, Part, Pieces
from gemelo.services.stepper_gateway.goals.trajectory_checks import ordered_trajectory
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.paths import RoundedPath, SampledPath, StraightLines, TimedPath
from gemelo.services.stepper_gateway.parameters import GatewayParameters


class GoalChecks:
    """Those of one goal with these parameters; joints that it does not name stay at `hold` (n,) [rad] or [m]."""

    def __init__(
        self,
        goal: FollowJointTrajectoryGoal,
        joints: tuple[Joint, ...],
        parameters: GatewayParameters,
        tick_hz: int,
        hold: Vector | None = None,
    ) -> None:
        self.goal, self.parameters, self.hold = goal, parameters, hold
        self._joints, self._tick_hz = joints, tick_hz
        self.form = Part(ordered_trajectory(goal.trajectory, joints, hold))
        self.points = Part(self._points())
        self._lines = Part(self._straight_lines())
        self.path = Part(self._own_path())
        self._lead_in: tuple[Knot, float, Part[None]] | None = None

    def pieces(self, start: Knot | None) -> Iterator[None]:
        """All of them as long as none rejects the goal; the way to the first point from `start` too, if it is known."""
        for part in (self.form, self.points):
            yield from part.go_on()
            if part.rejected is not None:
                return
        if self.is_single_point:
            return
        yield from self._lines.go_on()
        yield from self.path.go_on()
        if start is not None:
            yield from self._lead_in_part(start, 0.0).go_on()

    def are_of(self, goal: FollowJointTrajectoryGoal, parameters: GatewayParameters, hold: Vector | None) -> bool:
        """True if they are the checks of that very goal; `hold` (n,) [rad] or [m] counts where it names some joints."""
        is_whole = len(goal.trajectory.joint_names) == len(self._joints)
        return self.goal is goal and self.parameters == parameters and (is_whole or self.hold == hold)

    @property
    def is_single_point(self) -> bool:
        """True if the goal is a point without a path."""
        points = self.goal.trajectory.points
        return len(points) == 1 and not points[0].velocities

    def path_from(self, start: Knot, offset: float) -> TimedPath:
        """The path, entered `offset` [s] after its beginning, on the way from `start` to its first point too.

        Raises `GoalRejected` where it leaves a limit.
        """
        self._lead_in_part(start, offset).result()
        self.path.result()
        return self._whole_path(start, offset)

    def _points(self) -> Pieces[None]:
        yield from points_within(self.form.result(), self._joints)

    def _straight_lines(self) -> Pieces[StraightLines]:
        lines = StraightLines.of(self.form.result())
        while lines.integrate(PIECE):
            yield
        return lines

    def _own_path(self) -> Pieces[None]:
        """From the first point on, whatever comes before."""
        trajectory = self.form.result()
        path = self._path(trajectory, Knot.at_rest(trajectory.points[0].positions), 0.0)
        yield from self._within(path, Samples(path.duration, self._own_begin(trajectory)))

    def _lead_in_part(self, start: Knot, offset: float) -> Part[None]:
        if self._lead_in is None or self._lead_in[:2] != (start, offset):
            self._lead_in = start, offset, Part(self._lead_in_pieces(start, offset))
        return self._lead_in[2]

    def _lead_in_pieces(self, start: Knot, offset: float) -> Pieces[None]:
        path = self._whole_path(start, 0.0)
        end = self._own_begin(self.form.result())
        yield from self._within(path, Samples(path.duration, offset, end))

    def _within(self, path: TimedPath, samples: Samples) -> Pieces[None]:
        yield from path_within(path, samples, self._joints, self.parameters, self._tick_hz)

    def _own_begin(self, trajectory: JointTrajectory) -> float:
        """[s] from which on the path does not depend on where the arm is."""
        first = trajectory.points[0]
        if first.time_from_start == 0.0:
            return 0.0
        return first.time_from_start + (0.0 if first.velocities else self.parameters.corner_time)

    def _whole_path(self, start: Knot, offset: float) -> TimedPath:
        return self._path(self.form.result(), start, offset)

    def _path(self, trajectory: JointTrajectory, start: Knot, offset: float) -> TimedPath:
        if not trajectory.points[0].velocities:
            return RoundedPath(self._lines.result(), start.position, self.parameters.corner_time, offset)
        beginning = TrajectoryPoint(
            positions=start.position,
            velocities=start.velocity,
            accelerations=start.acceleration if trajectory.points[0].accelerations else (),
        )
        return SampledPath(TrajectorySampler(trajectory, beginning), offset)
