"""Trajectory points along timed ways, from rest to rest, so near that the quintics between them keep to the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from schemas.motion import JointTrajectory, TrajectoryPoint
from services.planner.timing.path_timing import TimeLaw
from services.planner.timing.profile import MARGIN, SHORTEST, JointLimits
from services.planner.tool.path_curve import PathCurve
from services.planner.verify.feasibility import slowed
from services.planner.verify.verify import Samples, limit_shares, sample

Array = NDArray[np.float64]
Error = Callable[[float, Array], float]  # [m] that the posture (n,) at a length is off the way

SPACING = 0.04  # [s] between points, before it is halved
HALVINGS = 4
OFF = 5e-5  # [m] by which the finished motion may leave the way


@dataclass(frozen=True)
class Run:
    """A way from rest to rest: its curve, whose first columns are the joints, and when it is where."""

    curve: PathCurve
    law: TimeLaw
    start: Array  # (n,) exact
    end: Array  # (n,) exact
    error: Error | None = None  # absent: any quintic through the points will do


def trajectory_along(names: Sequence[str], runs: Sequence[Run]) -> JointTrajectory:
    """One run after the other, at rest between them; every end is exact to the bit."""
    points: list[TrajectoryPoint] = []
    for run in runs:
        begin = points[-1].time_from_start if points else 0.0
        later = [replace(p, time_from_start=begin + p.time_from_start) for p in _near_enough(names, run)]
        points = points[:-1] + later
    return JointTrajectory(joint_names=tuple(names), points=tuple(points))


def normalised(trajectory: JointTrajectory, limits: JointLimits) -> JointTrajectory:
    """The same way in the time in which the joint that is asked most of is just within its limits."""
    velocity, acceleration, jerk = limit_shares(sample(trajectory), limits)
    asked = max(velocity, acceleration**0.5, jerk ** (1.0 / 3.0))
    return trajectory if asked == 0.0 else slowed(trajectory, MARGIN / asked)


def _near_enough(names: Sequence[str], run: Run) -> list[TrajectoryPoint]:
    """Points so dense that what is executed is not off the way."""
    spacing = SPACING
    for _ in range(HALVINGS):
        points = _points(run, spacing)
        if run.error is None or _farthest(names, run, points) <= OFF:
            return points
        spacing *= 0.5
    return _points(run, spacing)


def _farthest(names: Sequence[str], run: Run, points: list[TrajectoryPoint]) -> float:
    assert run.error is not None
    # Two quintics that agree in position, velocity and acceleration at both ends are farthest apart in the middle.
    rows = between(JointTrajectory(joint_names=tuple(names), points=tuple(points)), 2)
    lengths = [run.law.at(time)[0] for time in rows.times.tolist()]
    return max(run.error(length, row) for length, row in zip(lengths, rows.positions, strict=True))


def between(trajectory: JointTrajectory, parts: int) -> Samples:
    """Rows inside every segment, where its `parts` meet."""
    samples = sample(trajectory, parts)
    row = np.arange(len(samples.times)) % (parts + 1)
    inside = (row > 0) & (row < parts)
    return Samples(*(getattr(samples, field.name)[inside] for field in fields(samples)))


def _points(run: Run, spacing: float) -> list[TrajectoryPoint]:
    times = _times(run.law, spacing)
    states = np.array([run.law.at(time) for time in times]).reshape(-1, 3)
    way = run.curve.at(states[:, 0])
    speed, rise = states[:, 1:2], states[:, 2:3]
    joints = len(run.start)
    rows = (
        way.value[:, :joints],
        (way.first * speed)[:, :joints],
        (way.second * speed**2 + way.first * rise)[:, :joints],
    )
    inner = [
        TrajectoryPoint(positions=tuple(p), velocities=tuple(v), accelerations=tuple(a), time_from_start=time)
        for time, p, v, a in zip(times, *(row.tolist() for row in rows), strict=True)
    ]
    return [_rest(run.start, 0.0), *inner, _rest(run.end, run.law.duration)]


def _times(law: TimeLaw, spacing: float) -> list[float]:
    """Inside, ascending: where the jerk changes, and a grid between."""
    changes = [0.0]
    for change in law.changes:
        if change - changes[-1] >= SHORTEST and law.duration - change >= SHORTEST:
            changes.append(change)
    times: list[float] = []
    for low, high in pairwise([*changes, law.duration]):
        parts = max(1, round((high - low) / spacing))
        times += [low + (high - low) * part / parts for part in range(parts)]
    return times[1:]


def _rest(positions: Array, time: float) -> TrajectoryPoint:
    zeros = (0.0,) * len(positions)
    return TrajectoryPoint(
        positions=tuple(positions.tolist()), velocities=zeros, accelerations=zeros, time_from_start=time
    )
