"""Paths, the position of the arm at every time from 0 to a duration, and bridges from any state of motion onto one.

A bridge is continuous in position, velocity and acceleration.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from ruckig import InputParameter, Result, Ruckig, RuckigError, Synchronization, Trajectory

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import JointTrajectory
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits


class TimedPath(Protocol):
    """A motion as a function of time."""

    @property
    def duration(self) -> float:
        """[s]"""

    def at(self, t: float) -> Knot:
        """The knot at `t` [s], held at the ends."""


class SampledPath:
    """A trajectory with velocities (cubic) or accelerations (quintic), entered `offset` seconds after its start."""

    def __init__(self, sampler: TrajectorySampler, offset: float = 0.0) -> None:
        self._sampler = sampler
        self._offset = offset
        self.duration = max(0.0, sampler.duration - offset)

    def at(self, t: float) -> Knot:
        """The knot at `t` [s]."""
        return Knot(*self._sampler.at(t + self._offset))


class StraightLines:
    """Straight lines between positions, with the integral of the position over the time; held at both ends."""

    def __init__(self, times: Sequence[float], rows: Sequence[Vector], integral: Vector) -> None:
        """`times` [s], `rows` [rad] or [m]; `integral` is that at the first time, the others follow by `integrate`."""
        self.times, self.rows = times, rows
        self._integrals = [integral]

    @classmethod
    def of(cls, trajectory: JointTrajectory) -> StraightLines:
        """Those between its points."""
        points = trajectory.points
        zeros = tuple(0.0 for _ in points[0].positions)
        return cls([point.time_from_start for point in points], [point.positions for point in points], zeros)

    @classmethod
    def before(cls, lines: StraightLines, start: Vector) -> StraightLines:
        """The one from `start` at time 0 to the first point of `lines`, where its integral is 0 as theirs."""
        end, row = lines.times[0], lines.rows[0]
        made = cls([0.0, end], [start, row], tuple(-0.5 * end * (a + b) for a, b in zip(start, row, strict=True)))
        made._integrals.append(tuple(0.0 for _ in row))
        return made

    def integrate(self, count: int) -> bool:
        """Computes the integrals at `count` more points; False if there are no more."""
        times, rows = self.times, self.rows
        begin = len(self._integrals)
        for i in range(begin, min(begin + count, len(times))):
            step = 0.5 * (times[i] - times[i - 1])
            rises = zip(self._integrals[-1], rows[i - 1], rows[i], strict=True)
            self._integrals.append(tuple(s + step * (a + b) for s, a, b in rises))
        return len(self._integrals) < len(times)

    def at(self, t: float) -> tuple[Vector, Vector, Vector]:
        """Position, velocity and the position's integral at `t` [s]."""
        times, rows = self.times, self.rows
        zeros = tuple(0.0 for _ in rows[0])
        if t < times[0]:
            dt = t - times[0]
            return rows[0], zeros, tuple(s + dt * p for s, p in zip(self._integrals[0], rows[0], strict=True))
        i = bisect_right(times, t) - 1
        dt = t - times[i]
        if i == len(times) - 1:
            return rows[i], zeros, tuple(s + dt * p for s, p in zip(self._integrals[i], rows[i], strict=True))
        span = times[i + 1] - times[i]
        velocity = tuple((b - a) / span for a, b in zip(rows[i], rows[i + 1], strict=True))
        position = tuple(a + v * dt for a, v in zip(rows[i], velocity, strict=True))
        area = tuple(s + 0.5 * dt * (a + p) for s, a, p in zip(self._integrals[i], rows[i], position, strict=True))
        return position, velocity, area


class RoundedPath:
    """Straight lines between positions, each corner a parabola over `corner` seconds.

    It is the moving average of the straight lines over the last `corner` seconds: from rest to rest, with an
    acceleration of the change of velocity divided by `corner`, and over so much later.
    """

    def __init__(self, lines: StraightLines, start: Vector, corner: float, offset: float = 0.0) -> None:
        """`lines` with all their integrals; the arm comes to their first point from `start` where that is later."""
        self._lines = lines
        self._lead_in = StraightLines.before(lines, start) if lines.times[0] > 0.0 else None
        self._corner, self._offset = corner, offset
        self.duration = max(0.0, lines.times[-1] + corner - offset)

    def at(self, t: float) -> Knot:
        """The knot at `t` [s]."""
        late, early = t + self._offset, t + self._offset - self._corner
        p1, v1, s1 = self._line(late)
        p0, v0, s0 = self._line(early)
        corner = self._corner
        return Knot(
            tuple((b - a) / corner for a, b in zip(s0, s1, strict=True)),
            tuple((b - a) / corner for a, b in zip(p0, p1, strict=True)),
            tuple((b - a) / corner for a, b in zip(v0, v1, strict=True)),
        )

    def _line(self, t: float) -> tuple[Vector, Vector, Vector]:
        if self._lead_in is not None and t < self._lines.times[0]:
            return self._lead_in.at(t)
        return self._lines.at(t)


class ProfilePath:
    """A jerk-limited profile of ruckig from one knot to another."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self.duration: float = trajectory.duration

    def at(self, t: float) -> Knot:
        """The knot at `t` [s]."""
        position, velocity, acceleration = self._trajectory.at_time(min(max(t, 0.0), self.duration))
        return Knot(tuple(position), tuple(velocity), tuple(acceleration))


def profile(start: Knot, target: Knot, limits: Limits, duration: float | None = None) -> ProfilePath | None:
    """From `start` to `target` as fast as the limits allow, or in exactly `duration` [s]; None if that cannot be."""
    problem = InputParameter(len(start.position))
    problem.current_position, problem.target_position = start.position, target.position
    problem.current_velocity, problem.target_velocity = start.velocity, target.velocity
    problem.current_acceleration, problem.target_acceleration = start.acceleration, target.acceleration
    limits = limits.raised_to(start, target)
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = limits
    problem.synchronization = Synchronization.Phase
    if duration is not None:
        problem.minimum_duration = duration
    trajectory = Trajectory(len(start.position))
    try:
        result = Ruckig(len(start.position)).calculate(problem, trajectory)
    except RuckigError:  # no profile satisfies this, or rounding hides the one that does
        return None
    if result not in (Result.Working, Result.Finished):
        return None
    if duration is not None and trajectory.duration > duration + 1e-6:
        return None
    return ProfilePath(trajectory)


GRID = 0.02  # [s] between the times at which the path may be met; chosen: one for each knot
GRID_POINTS = 150  # at most so many are tried, coarser on long paths; chosen: bounds the time of a step of the loop
SAMPLE = 0.01  # [s] between the instants at which a join is checked; chosen: two for each knot

Within = Callable[[Knot], bool]


class JoinedPath:
    """The join until `meets`, then the path itself."""

    def __init__(self, join: ProfilePath, path: TimedPath, meets: float) -> None:
        self._bridge = join
        self._path = path
        self.meets = meets  # [s]
        self.duration = max(path.duration, meets)

    def at(self, t: float) -> Knot:
        """The knot at `t` [s]."""
        return self._bridge.at(t) if t < self.meets else self._path.at(t)


def join_path(start: Knot, path: TimedPath, limits: Limits, within: Within) -> TimedPath | None:
    """`path`, joined from `start` as early as the limits allow; else straight to its end; None if that leaves `within`.

    The join ends at the smallest time of the grid at which the state-to-state minimum is no longer than that
    time, stretched to exactly it.
    """
    for meets in _grid(path.duration):
        target = path.at(meets)
        if (fastest := profile(start, target, limits)) is None or fastest.duration > meets:
            continue
        joined = profile(start, target, limits, meets)
        if joined is not None and _stays(joined, within):
            return JoinedPath(joined, path, meets)
    direct = profile(start, Knot.at_rest(path.at(path.duration).position), limits)
    return direct if direct is not None and _stays(direct, within) else None


def _grid(duration: float) -> Iterator[float]:
    count = max(1, min(GRID_POINTS, int(duration / GRID)))
    return (duration * (i + 1) / count for i in range(count))


def _stays(path: ProfilePath, within: Within) -> bool:
    count = int(path.duration / SAMPLE) + 1
    return all(within(path.at(path.duration * i / count)) for i in range(count + 1))
