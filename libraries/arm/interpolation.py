"""Trajectories between their points: linear, cubic or quintic, by the fields present."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from gemelo.schemas.message import Vector
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint

Coefficients = tuple[float, float, float, float, float, float]
Sample = tuple[Vector, Vector, Vector]


class TrajectorySampler:
    """Position, velocity and acceleration of a trajectory at any time, held at its ends.

    A segment is quintic where both of its points have accelerations, cubic where both have velocities, else linear.
    `start` is where the arm is at time 0, for a trajectory whose first point comes later.
    """

    def __init__(self, trajectory: JointTrajectory, start: TrajectoryPoint | None = None) -> None:
        points = list(trajectory.points)
        if not points:
            raise ValueError("a trajectory without points has no positions")
        if start is not None and points[0].time_from_start > 0.0:
            points.insert(0, _at_zero(start))
        self._points = points
        self._times = [point.time_from_start for point in points]
        self._segments: dict[int, tuple[Coefficients, ...]] = {}

    @property
    def duration(self) -> float:
        """[s] from the trajectory's zero to its last point."""
        return self._times[-1]

    def at(self, t: float) -> Sample:
        """Positions, velocities and accelerations at `t` [s] from the start; at rest outside the trajectory."""
        if t < self._times[0]:
            return _at_rest(self._points[0])
        if t >= self._times[-1]:
            return _exactly(self._points[-1]) if t == self._times[-1] else _at_rest(self._points[-1])
        index = bisect_right(self._times, t) - 1
        return _evaluate(self._segment(index), t - self._times[index])

    def _segment(self, index: int) -> tuple[Coefficients, ...]:
        found = self._segments.get(index)
        if found is None:
            found = self._segments[index] = segment_coefficients(self._points[index], self._points[index + 1])
        return found


def segment_coefficients(first: TrajectoryPoint, second: TrajectoryPoint) -> tuple[Coefficients, ...]:
    """Per joint, the coefficients of powers 0 to 5 of the time since `first` [s]."""
    dt = second.time_from_start - first.time_from_start
    if dt <= 0.0:
        raise ValueError(f"time_from_start does not increase: {first.time_from_start} then {second.time_from_start}")
    p0, p1 = first.positions, second.positions
    if not (first.velocities and second.velocities):
        return tuple((a, (b - a) / dt, 0.0, 0.0, 0.0, 0.0) for a, b in zip(p0, p1, strict=True))
    v0, v1 = first.velocities, second.velocities
    if not (first.accelerations and second.accelerations):
        return tuple(cubic(b0, w0, b1, w1, dt) for b0, w0, b1, w1 in zip(p0, v0, p1, v1, strict=True))
    a0, a1 = first.accelerations, second.accelerations
    rows = zip(p0, v0, a0, p1, v1, a1, strict=True)
    return tuple(quintic(b0, w0, c0, b1, w1, c1, dt) for b0, w0, c0, b1, w1, c1 in rows)


def cubic(p0: float, v0: float, p1: float, v1: float, dt: float) -> Coefficients:
    """The cubic Hermite polynomial through both ends (Biagiotti and Melchiorri 2008, section 2.1).

    Positions [rad] or [m], velocities [rad/s] or [m/s], `dt` [s]; coefficients of powers 0 to 5 of the time [s].
    """
    rise = (p1 - p0) / dt
    return p0, v0, (3.0 * rise - 2.0 * v0 - v1) / dt, (v0 + v1 - 2.0 * rise) / (dt * dt), 0.0, 0.0


def quintic(p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, dt: float) -> Coefficients:
    """The quintic polynomial, after subtracting the parabola of the first end (the same section).

    Positions `p0`, `p1` [rad] or [m], velocities `v0`, `v1` [rad/s] or [m/s], accelerations `a0`, `a1` [rad/s^2] or
    [m/s^2], `dt` [s]; coefficients as of `cubic`.
    """
    rise = p1 - p0 - (v0 + 0.5 * a0 * dt) * dt
    climb = (v1 - v0 - a0 * dt) * dt
    bend = (a1 - a0) * dt * dt
    return (
        p0,
        v0,
        0.5 * a0,
        (10.0 * rise - 4.0 * climb + 0.5 * bend) / dt**3,
        (-15.0 * rise + 7.0 * climb - bend) / dt**4,
        (6.0 * rise - 3.0 * climb + 0.5 * bend) / dt**5,
    )


def _evaluate(segment: Sequence[Coefficients], t: float) -> Sample:
    positions, velocities, accelerations = [], [], []
    for c0, c1, c2, c3, c4, c5 in segment:
        positions.append(c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))))
        velocities.append(c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))))
        accelerations.append(2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)))
    return tuple(positions), tuple(velocities), tuple(accelerations)


def _exactly(point: TrajectoryPoint) -> Sample:
    zeros = (0.0,) * len(point.positions)
    return point.positions, point.velocities or zeros, point.accelerations or zeros


def _at_rest(point: TrajectoryPoint) -> Sample:
    zeros = (0.0,) * len(point.positions)
    return point.positions, zeros, zeros


def _at_zero(start: TrajectoryPoint) -> TrajectoryPoint:
    return TrajectoryPoint(
        positions=start.positions, velocities=start.velocities, accelerations=start.accelerations, time_from_start=0.0
    )
