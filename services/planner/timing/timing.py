"""Jerk-limited time along a smooth way: fast where it is straight, slow enough where it bends.

The way is cut into sections. In each the speed along the way, its acceleration and its jerk have bounds under which no
joint can exceed its own: q' = y1 v, q'' = y2 v^2 + y1 a, q''' = y3 v^3 + 3 y2 v a + y1 j, with y1, y2, y3 the way's
derivatives by its length. ruckig goes through each section, from the speed at its beginning to that at its end, where
the speed is steady. At last all is sped up or slowed down evenly until one joint is at one of its limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

from schemas.motion import JointTrajectory, TrajectoryPoint
from services.planner.search.curve import Curve, smooth_runs
from services.planner.timing.profile import MARGIN, JointLimits, NoProfile, straight_line
from services.planner.verify.verify import Samples, limit_shares, sample, sample_between

Array = NDArray[np.float64]

BENDING = 0.8  # share of the acceleration's limit that bending may use
TWISTING = 0.6  # share of the jerk's limit that the bend's own change may use
CROSSING = 0.15  # share of the jerk's limit for accelerating in a bend
CUTS = 4  # sections of a piece, before the ones that are alike become one
SAMPLES = 5  # of a section, at which its bounds are taken
ALIKE = 1.15  # sections whose speeds differ by less are one
SPACING = 0.04  # [s] between points on a straight stretch
CURVED = 0.016  # [s] in a bend
STRAIGHT = 1e-9  # 1/s of bend below which a piece is straight
FEWEST = 1e-3  # [s] two points nearer than that are one


@dataclass(frozen=True)
class Section:
    """A stretch of the way with bounds of the movement along it."""

    length: float  # [s at full speed]
    speed: float
    acceleration: float
    jerk: float
    bends: bool


class States(NamedTuple):
    """`times` (m,) [s], and joint values and their derivatives (m, n) there."""

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array


def states_along(run: Curve, limits: JointLimits, times: Array, lengths: Array, speeds: Array, bends: Array) -> States:
    """Of the joints, where the way's length, speed and acceleration (m,) are these."""
    way = run.at(lengths)
    first, second, scale = way.first, way.second, limits.velocity
    velocities = first * speeds[:, None]
    accelerations = second * (speeds * speeds)[:, None] + first * bends[:, None]
    return States(times, way.value * scale, velocities * scale, accelerations * scale)


def timed_way(names: Sequence[str], control: Array, limits: JointLimits) -> JointTrajectory:
    """From rest to rest along the uniform cubic B-spline of `control` (k, n), both ends exact; raises `NoProfile`.

    At corners it stops. Raises `TurnsOnTheSpot` where the curve does so without a corner.
    """
    return along_runs(names, control, limits, _run_states)


def along_runs(
    names: Sequence[str],
    control: Array,
    limits: JointLimits,
    timed: Callable[[Curve, JointLimits], States],
    with_jerk: bool = True,
) -> JointTrajectory:
    """Every smooth run of the curve, timed from rest to rest, one after the other, as fast as the limits allow."""
    runs: list[States] = []
    clock = 0.0
    for run in smooth_runs(control, limits.velocity):
        states = timed(run, limits)
        runs.append(states._replace(times=states.times + clock))
        clock = float(runs[-1].times[-1])
    if not runs:
        return straight_line(names, control[0].tolist(), control[-1].tolist(), limits)
    whole = States(*(np.concatenate(columns) for columns in zip(*runs, strict=True)))
    kept = np.concatenate(([True], np.diff(whole.times) > 0.0))
    states = States(*(column[kept] for column in whole))
    states.positions[0], states.positions[-1] = control[0], control[-1]
    states.velocities[[0, -1]] = states.accelerations[[0, -1]] = 0.0
    return _trajectory(names, _at_limits(states, limits, with_jerk))


def normalised(trajectory: JointTrajectory, limits: JointLimits) -> JointTrajectory:
    """The same way in the time in which the joint that is asked most of is just within its limits."""
    fastest = _fastest(sample(trajectory), limits)
    return trajectory if fastest == math.inf else at_speed(trajectory, fastest)


def at_speed(trajectory: JointTrajectory, scale: float) -> JointTrajectory:
    """The same way at `scale` times the speed."""
    points = tuple(
        TrajectoryPoint(
            positions=point.positions,
            velocities=tuple(value * scale for value in point.velocities),
            accelerations=tuple(value * scale * scale for value in point.accelerations),
            time_from_start=point.time_from_start / scale,
        )
        for point in trajectory.points
    )
    return JointTrajectory(stamp=trajectory.stamp, joint_names=trajectory.joint_names, points=points)


def _fastest(samples: Samples, limits: JointLimits, with_jerk: bool = True) -> float:
    """The scale of the speed at which one joint is just within one of its limits; infinite at rest."""
    velocity, acceleration, jerk = limit_shares(samples, limits)
    most = max(velocity, acceleration**0.5, jerk ** (1.0 / 3.0) if with_jerk else 0.0)
    return MARGIN / most if most > 0.0 else math.inf


def _at_limits(states: States, limits: JointLimits, with_jerk: bool) -> States:
    """As `normalised`."""
    scale = _fastest(sample_between(*states), limits, with_jerk)
    times, positions, velocities, accelerations = states
    return States(times / scale, positions, velocities * scale, accelerations * scale * scale)


def _trajectory(names: Sequence[str], states: States) -> JointTrajectory:
    rows = zip(*(column.tolist() for column in states), strict=True)
    points = [
        TrajectoryPoint(positions=tuple(p), velocities=tuple(v), accelerations=tuple(a), time_from_start=t)
        for t, p, v, a in rows
    ]
    return JointTrajectory(joint_names=tuple(names), points=tuple(points))


def _run_states(run: Curve, limits: JointLimits) -> States:
    """Of one run, from its beginning."""
    sections = _merged(_sections(run, limits))
    speeds = _boundary_speeds(sections)
    rows: list[Array] = []
    clock = travelled = 0.0
    for section, before, after in zip(sections, speeds[:-1], speeds[1:], strict=True):
        part = _through(section, before, after)
        part[:, 0] += clock
        part[:, 1] += travelled
        rows.append(part)
        clock, travelled = float(part[-1, 0]), travelled + section.length
    return states_along(run, limits, *np.concatenate(rows).T)


def _sections(run: Curve, limits: JointLimits) -> list[Section]:
    """Some for each piece of the curve, with the bounds of all their samples."""
    ends = np.arange(CUTS * (len(run.knots) - 1) + 1) / CUTS
    knots = np.interp(ends, np.arange(len(run.knots)), run.knots)
    inside = np.linspace(1e-6, 1.0 - 1e-6, SAMPLES)
    lengths = np.diff(knots)
    way = run.at((knots[:-1, None] + lengths[:, None] * inside).reshape(-1))
    shape = (len(lengths), SAMPLES, -1)
    tiny = 1e-12
    y1, y2, y3 = (np.abs(part).reshape(shape) + tiny for part in way[1:])
    most_a, most_j = limits.acceleration / limits.velocity, limits.jerk / limits.velocity
    speed = np.minimum(1.0 / y1, np.minimum((BENDING * most_a / y2) ** 0.5, (TWISTING * most_j / y3) ** (1.0 / 3.0)))
    v = speed.min(axis=(1, 2))
    squared = (v * v)[:, None, None]
    along = ((most_a - y2 * squared) / y1).min(axis=(1, 2))
    across = (CROSSING * most_j / (3.0 * y2 * v[:, None, None])).min(axis=(1, 2))
    left = (
        most_j - y3 * v[:, None, None] ** 3 - np.minimum(CROSSING * most_j, 3.0 * y2 * v[:, None, None] * most_a / y1)
    )
    j = (left / y1).min(axis=(1, 2))
    bends = y2.max(axis=(1, 2)) > STRAIGHT
    rows = zip(
        lengths.tolist(), v.tolist(), np.minimum(along, across).tolist(), j.tolist(), bends.tolist(), strict=True
    )
    return [Section(*row) for row in rows]


def _merged(sections: list[Section]) -> list[Section]:
    """Fewer of them: neighbours that are about as fast become one, under the bounds of the slower."""
    merged = [sections[0]]
    for section in sections[1:]:
        last = merged[-1]
        if max(last.speed, section.speed) <= ALIKE * min(last.speed, section.speed):
            merged[-1] = Section(
                last.length + section.length,
                min(last.speed, section.speed),
                min(last.acceleration, section.acceleration),
                min(last.jerk, section.jerk),
                last.bends or section.bends,
            )
        else:
            merged.append(section)
    return merged


def _boundary_speeds(sections: list[Section]) -> list[float]:
    """Steady speeds between the sections, that can be reached from rest and brought to rest."""
    speeds = [0.0, *(min(one.speed, other.speed) for one, other in pairwise(sections)), 0.0]
    for index, section in enumerate(sections[:-1]):
        speeds[index + 1] = min(speeds[index + 1], _reachable(speeds[index], section))
    for index in range(len(sections) - 1, 0, -1):
        speeds[index] = min(speeds[index], _reachable(speeds[index + 1], sections[index]))
    return speeds


def _reachable(speed: float, section: Section) -> float:
    """The fastest steady speed at the other end of the section, by bisection."""
    low, high = speed, max(speed, section.speed)
    if _distance(low, high, section) <= section.length:
        return high
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if _distance(low=speed, high=middle, section=section) <= section.length else (low, middle)
        )
    return low


def _distance(low: float, high: float, section: Section) -> float:
    """What a jerk-limited change of speed takes, steady before and after."""
    change, a, j = high - low, section.acceleration, section.jerk
    duration = change / a + a / j if change * j >= a * a else 2.0 * (change / j) ** 0.5
    return 0.5 * (low + high) * duration


def _through(section: Section, before: float, after: float) -> Array:
    """(m, 4) time, length, speed and acceleration through a section, where the jerk changes and between."""
    demand = InputParameter(1)
    demand.current_velocity, demand.target_velocity = [before], [after]
    demand.target_position = [section.length]
    demand.max_velocity, demand.max_acceleration = [section.speed], [section.acceleration]
    demand.max_jerk = [section.jerk]
    profile = Trajectory(1)
    try:
        result = Ruckig(1).calculate(demand, profile)
    except RuckigError as error:
        raise NoProfile(f"no jerk-limited profile through a stretch of {section.length:.3g} s") from error
    if result not in (Result.Working, Result.Finished):
        raise NoProfile(f"no jerk-limited profile through a stretch of {section.length:.3g} s: {result.name}")
    changes = np.unique([0.0, *np.cumsum(profile.profiles[0][0].t), profile.duration])
    changes = changes[np.concatenate(([True], np.diff(changes) > FEWEST))]
    changes[-1] = profile.duration
    spacing = CURVED if section.bends else SPACING
    parts = [np.linspace(a, b, max(1, round((b - a) / spacing)), endpoint=False) for a, b in pairwise(changes.tolist())]
    times = np.concatenate([*parts, [profile.duration]])
    states = np.array([profile.at_time(t) for t in times.tolist()]).reshape(len(times), 3)
    return np.column_stack((times, states))
