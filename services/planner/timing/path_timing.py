"""Time along a given way: jerk-limited by stretches, each with the speed, acceleration and jerk that all limits allow.

With q(s) the way and s(t) its time law: q' = q_s s', q'' = q_ss s'^2 + q_s s'', q''' = q_sss s'^3 + 3 q_ss s' s'' +
q_s s''' (Biagiotti and Melchiorri 2008, section 9.1). Between stretches the speed is carried on, at no acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

from services.planner.timing.profile import JointLimits, NoProfile
from services.planner.tool.path_curve import PathCurve

Array = NDArray[np.float64]

NEAR = 1e-4  # share of the length: marks that are nearer to one another are one
ASIDE = 1e-6  # share of the length from a mark at which the way is that of one side
ROWS = 512  # of length at which limits are looked at, besides the knots and the marks
COUNTS = (1, 4, 16)  # of even stretches that are tried; they divide ROWS
PARTS = 4  # of a stretch of one kind
SHARES = (1.0, 0.7, 0.45)  # of the speed that the way allows: slower leaves more for acceleration
CENTRIPETAL = 0.8  # share of the acceleration that curvature may take
JERK_OF_SPEED, JERK_OF_BOTH = 0.5, 0.25  # shares of the jerk: of q_sss s'^3, and of 3 q_ss s' s''
MARGIN = 0.98  # share of the limits that is used: the quintics between points swing a little
FASTEST = 1e3  # [lengths of the way per second], where nothing else limits
HALVINGS = 30


@dataclass(frozen=True)
class Demand:
    """(m, k) each: how the limited quantities change with the length, their absolute values; limits (k,)."""

    along: Array  # (m,)
    first: Array
    second: Array
    third: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    marks: Array  # lengths from 0 to the end between which the way is of one kind


@dataclass(frozen=True)
class Bounds:
    """Of the length's time law in one stretch."""

    velocity: float
    acceleration: float
    jerk: float


class TimeLaw:
    """Length by time, from rest to rest; `changes` are the times [s] at which its jerk changes."""

    def __init__(self, stretches: list[tuple[float, Trajectory]]) -> None:
        self._begins = [begin for begin, _ in stretches]
        self._profiles = [profile for _, profile in stretches]
        ends = np.cumsum([profile.duration for profile in self._profiles])
        self._times = np.concatenate(([0.0], ends[:-1]))
        self.duration = float(ends[-1])
        self.changes = [
            float(time + change)
            for time, profile in zip(self._times, self._profiles, strict=True)
            for change in np.cumsum(profile.profiles[0][0].t)
        ]

    def at(self, time: float) -> tuple[float, float, float]:
        """Length, its speed and acceleration at a time [s]."""
        index = int(np.searchsorted(self._times, time, side="right")) - 1
        position, velocity, acceleration = self._profiles[index].at_time(time - float(self._times[index]))
        return self._begins[index] + float(position[0]), float(velocity[0]), float(acceleration[0])


def demand_of(curve: PathCurve, limits: JointLimits, tool: tuple[float, float], marks: Array) -> Demand:
    """What `curve` asks of the joints, and of the tool, where its position is in the columns behind them.

    `tool` is its speed [m/s] and acceleration [m/s^2], 0 for no limit.
    """
    end, joints = float(curve.knots[-1]), len(limits.velocity)
    aside, marks = ASIDE * end, _apart(marks, NEAR * end)
    inside = [np.linspace(low, high, 4 * PARTS + 1) for low, high in pairwise(marks.tolist())]
    middles = 0.5 * (curve.knots[:-1] + curve.knots[1:])
    rows = (np.linspace(0.0, end, ROWS + 1), curve.knots, middles, marks[:-1] + aside, marks[1:] - aside)
    along = np.unique(np.concatenate((*rows, *inside)))
    _, *derivatives = curve.at(along)
    first, second, third = [np.hstack((np.abs(part[:, :joints]), _norms(part[:, joints:]))) for part in derivatives]
    speed, most = (value if value > 0.0 else math.inf for value in tool)
    return Demand(
        along,
        first,
        second,
        third,
        velocity=MARGIN * np.append(limits.velocity, speed),
        acceleration=MARGIN * np.append(limits.acceleration, most),
        jerk=MARGIN * np.append(limits.jerk, math.inf),
        marks=marks,
    )


def time_law(demand: Demand) -> TimeLaw:
    """The fastest of several divisions into stretches; raises `NoProfile`."""
    whole, *finer = _divisions(demand)
    tries = [(whole, share) for share in SHARES] + [(edges, share) for edges in finer for share in SHARES[:2]]
    laws = [_law(demand, edges, share) for edges, share in tries]
    found = [law for law in laws if law is not None]
    if not found:
        raise NoProfile(f"no jerk-limited profile for a way of {float(demand.along[-1]):.3g}")
    return min(found, key=lambda law: law.duration)


def _apart(marks: Array, least: float) -> Array:
    """Both ends, and those between that are `least` from one another."""
    kept = [float(marks[0])]
    for mark in marks[1:-1].tolist():
        if mark - kept[-1] > least and float(marks[-1]) - mark > least:
            kept.append(mark)
    return np.array([*kept, float(marks[-1])])


def _divisions(demand: Demand) -> list[Array]:
    """Edges of stretches: of even ones, and where the way is of different kinds also of parts of these."""
    end, marks = float(demand.along[-1]), demand.marks
    even = [np.linspace(0.0, end, count + 1) for count in COUNTS]
    if len(marks) == 2:
        return even
    finer = np.unique(np.concatenate([np.linspace(low, high, PARTS + 1) for low, high in pairwise(marks.tolist())]))
    return [even[0], marks, finer]


def _law(demand: Demand, edges: Array, share: float) -> TimeLaw | None:
    lengths = np.diff(edges).tolist()
    bounds = [_bounds(demand, *pair, share) for pair in pairwise(edges.tolist())]
    speeds = _edge_speeds(bounds, lengths)
    stretches: list[tuple[float, Trajectory]] = []
    rows = zip(edges.tolist(), lengths, bounds, pairwise(speeds), strict=False)
    for begin, length, bound, (before, after) in rows:
        profile = _profile(length, bound, before, after)
        if profile is None:
            return None
        stretches.append((begin, profile))
    return TimeLaw(stretches)


def _bounds(demand: Demand, begin: float, end: float, share: float) -> Bounds:
    """What every row in the stretch allows at every speed up to the one given."""
    inside = 0.5 * ASIDE * float(demand.along[-1])
    low, high = np.searchsorted(demand.along, (begin + inside, end - inside))
    first, second, third = demand.first[low:high], demand.second[low:high], demand.third[low:high]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        velocity = share * min(
            _least(demand.velocity / first),
            math.sqrt(_least(CENTRIPETAL * demand.acceleration / second)),
            _least(JERK_OF_SPEED * demand.jerk / third) ** (1.0 / 3.0),
            FASTEST * float(demand.along[-1]) / share,
        )
        acceleration = min(
            _least((demand.acceleration - second * velocity**2) / first),
            _least(JERK_OF_BOTH * demand.jerk / (3.0 * second * velocity)),
            FASTEST * velocity,
        )
        used = third * velocity**3 + 3.0 * second * velocity * acceleration
        jerk = min(_least((demand.jerk - used) / first), FASTEST * acceleration)
    return Bounds(velocity, acceleration, jerk)


def _edge_speeds(bounds: list[Bounds], lengths: list[float]) -> list[float]:
    """At the stretches' ends: rest, and between what both sides allow and can be reached, forward and back."""
    speeds = [0.0, *(min(one.velocity, other.velocity) for one, other in pairwise(bounds)), 0.0]
    stretches = list(enumerate(zip(bounds, lengths, strict=True)))
    for index, (bound, length) in stretches:
        speeds[index + 1] = min(speeds[index + 1], _reachable(speeds[index], length, bound))
    for index, (bound, length) in reversed(stretches):
        speeds[index] = min(speeds[index], _reachable(speeds[index + 1], length, bound))
    return speeds


def _reachable(speed: float, length: float, bound: Bounds) -> float:
    """The highest speed after `length`, from and to no acceleration: (v + w) / 2 times the duration is the length."""
    low, high = 0.0, max(0.0, bound.velocity - speed)
    for _ in range(HALVINGS):
        rise = 0.5 * (low + high)
        is_long = rise > bound.acceleration**2 / bound.jerk
        lasts = (
            rise / bound.acceleration + bound.acceleration / bound.jerk
            if is_long
            else 2.0 * math.sqrt(rise / bound.jerk)
        )
        low, high = (rise, high) if (speed + 0.5 * rise) * lasts <= (1.0 - 1e-9) * length else (low, rise)
    return speed + low


def _profile(length: float, bound: Bounds, before: float, after: float) -> Trajectory | None:
    demand = InputParameter(1)
    demand.target_position = [length]
    demand.current_velocity, demand.target_velocity = [before], [after]
    demand.max_velocity, demand.max_acceleration, demand.max_jerk = (
        [bound.velocity],
        [bound.acceleration],
        [bound.jerk],
    )
    profile = Trajectory(1)
    try:
        result = Ruckig(1).calculate(demand, profile)
    except RuckigError:
        return None
    return profile if result in (Result.Working, Result.Finished) else None


def _norms(rows: Array) -> Array:
    """(m, 1): the lengths of the rows; 0 where they are empty."""
    return np.asarray(np.linalg.norm(rows, axis=1, keepdims=True))


def _least(values: Array) -> float:
    return float(np.nanmin(values))
