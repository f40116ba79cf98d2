"""Time along a given path: jerk-limited by stretches, each with the speed, acceleration and jerk that all limits allow.

With q(s) the path and s(t) its time law: q' = q_s s', q'' = q_ss s'^2 + q_s s'', q''' = q_sss s'^3 + 3 q_ss s' s'' +
q_s s''' (Biagiotti and Melchiorri 2008, section 9.1). Between stretches the speed is carried on, at no acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.planning import Timing
from gemelo.schemas.reasons import because
from gemelo.services.planner.path.path_curve import PathCurve
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.timing.bounds import (
    PathDerivatives,
    QuantityLimits,
    acceleration_bound,
    crossing_term,
    jerk_bound,
    speed_bound,
)
from gemelo.services.planner.timing.profile import JointLimits, NoProfile, require_short
from gemelo.services.planner.timing.sections import Section
from gemelo.services.planner.timing.time_law import TimeLaw
from gemelo.services.planner.timing.time_optimal import time_optimal_law
from gemelo.services.planner.timing.timing import stretches_through

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
NEAR = 1e-4  # share of the length: marks that are nearer to one another are one
ASIDE = 1e-6  # share of the length from a mark at which the path is that of one side
ROWS = 128  # of length at which limits are looked at, besides the knots and the marks
COUNTS = (1, 4, 16)  # of even stretches that are tried; they divide ROWS
PARTS = 4  # of a stretch of one kind; chosen: bounds differ little within a quarter
SHARES = (1.0, 0.7, 0.45)  # of the speed that the path allows: slower leaves more for acceleration
CENTRIPETAL = 0.8  # share of the acceleration that curvature may take; chosen: the rest is for speeding up in a bend
JERK_OF_SPEED, JERK_OF_BOTH = 0.5, 0.25  # shares of the jerk: of q_sss s'^3, and of 3 q_ss s' s''
MARGIN = 0.98  # share of the limits that is used: the quintics between points swing a little
FASTEST = 1e3  # [lengths of the path per second], where nothing else limits; chosen: beyond any arm


class Law(Protocol):
    """The path's length by time, from rest to rest."""

    @property
    def duration(self) -> float:
        """Time [s] from rest to rest."""

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Length, speed and acceleration (m,) along the path at `times` (m,) [s]."""

    def times(self, lengths: Array, spacing: float) -> Array:
        """Ascending times [s] of the trajectory's points, from 0 to the end; `spacing` [s] is the wanted interval
        between them."""


@dataclass(frozen=True)
class Demand:
    """A path at lengths `along` (m,), and the limits of the k quantities that it moves: the joints, and the tool."""

    along: Array  # (m,)
    path: PathDerivatives
    limits: QuantityLimits
    marks: Array  # lengths from 0 to the end between which the path is of one kind

    @cached_property
    def speeds(self) -> Array:
        """The highest speed (m,) at each row, in the path's unit of length per s."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return _least(speed_bound(self.path, self.limits, CENTRIPETAL, JERK_OF_SPEED))

    def rows(self, edges: Array) -> NDArray[np.int64]:
        """(j, 2) first row and row after the last one in each stretch between `edges` (j + 1,), which are in the path's
        unit of length."""
        inside = 0.5 * ASIDE * float(self.along[-1])
        return np.searchsorted(self.along, np.column_stack((edges[:-1] + inside, edges[1:] - inside)))

    def least_duration(self, edges: Array) -> float:
        """[s] at the highest speeds that the stretches between `edges` (j + 1,) allow."""
        return float(np.sum(np.diff(edges) / _least_in(self.speeds, self.rows(edges))))


def law_along(
    curve: PathCurve, limits: JointLimits, tool: tuple[float, float], marks: Array, timing: Timing, deadline: Deadline
) -> Law:
    """Of the kind that was asked for; `tool` is its speed [m/s] and acceleration [m/s^2], 0 for no limit.

    Its position is in the columns behind the joints; raises `NoProfile`, and `PlanRefused` once the deadline has
    passed."""
    if timing is Timing.JERK_LIMITED:
        return time_law(demand_of(curve, limits, tool, marks), deadline)
    deadline.check()
    return time_optimal_law(curve, limits, tool)


def demand_of(curve: PathCurve, limits: JointLimits, tool: tuple[float, float], marks: Array) -> Demand:
    """The derivatives of `curve` and the limits of the joints and of the tool; `tool` is its speed [m/s] and
    acceleration [m/s^2], 0 for no limit, `marks` are lengths of the curve."""
    end, joints = float(curve.knots[-1]), len(limits.velocity)
    aside, marks = ASIDE * end, _apart(marks, NEAR * end)
    inside = [np.linspace(low, high, 4 * PARTS + 1) for low, high in pairwise(marks.tolist())]
    middles = 0.5 * (curve.knots[:-1] + curve.knots[1:])
    rows = (np.linspace(0.0, end, ROWS + 1), curve.knots, middles, marks[:-1] + aside, marks[1:] - aside)
    along = np.unique(np.concatenate((*rows, *inside)))
    _, *derivatives = curve.at(along)
    path = PathDerivatives(*(np.hstack((np.abs(part[:, :joints]), _norms(part[:, joints:]))) for part in derivatives))
    speed, most = (value if value > 0.0 else math.inf for value in tool)
    of_tool = QuantityLimits(
        velocity=MARGIN * np.append(limits.velocity, speed),
        acceleration=MARGIN * np.append(limits.acceleration, most),
        jerk=MARGIN * np.append(limits.jerk, math.inf),
    )
    return Demand(along, path, of_tool, marks)


def time_law(demand: Demand, deadline: Deadline) -> TimeLaw:
    """The fastest of several divisions into stretches; raises `NoProfile`."""
    whole, *finer = _divisions(demand)
    tries = [(edges, share) for edges in reversed(finer) for share in SHARES[:2]]
    tries += [(whole, share) for share in SHARES]
    best: TimeLaw | None = None
    why = NoProfile(because("plan.timing.none", length=float(demand.along[-1])))
    for edges, share in tries:
        deadline.check()
        try:
            if best is None or demand.least_duration(edges) < share * best.duration:
                law = TimeLaw(stretches_through(_sections(demand, edges, share)))
                best = law if best is None or law.duration < best.duration else best
        except NoProfile as error:
            why = error
    if best is None:
        raise why
    return best


def _apart(marks: Array, least: float) -> Array:
    """Both ends, and those between that are `least` from one another."""
    kept = [float(marks[0])]
    for mark in marks[1:-1].tolist():
        if mark - kept[-1] > least and float(marks[-1]) - mark > least:
            kept.append(mark)
    return np.array([*kept, float(marks[-1])])


def _divisions(demand: Demand) -> list[Array]:
    """Edges of stretches: of even ones, and where the path is of different kinds also of parts of these."""
    end, marks = float(demand.along[-1]), demand.marks
    even = [np.linspace(0.0, end, count + 1) for count in COUNTS]
    if len(marks) == 2:
        return even
    finer = np.unique(np.concatenate([np.linspace(low, high, PARTS + 1) for low, high in pairwise(marks.tolist())]))
    return [even[0], marks, finer]


def _sections(demand: Demand, edges: Array, share: float) -> list[Section]:
    """With what every row in each of them allows at every speed up to the one given; raises `NoProfile`."""
    end = float(demand.along[-1])
    bounds = demand.rows(edges)
    path, limits = demand.path, demand.limits
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        speed = np.fmin(share * _least_in(demand.speeds, bounds), FASTEST * end)
        fast = _spread(speed, bounds, len(demand.along))[:, None]
        rises = _least(acceleration_bound(path, limits, fast, JERK_OF_BOTH))
        rise = np.fmin(_least_in(rises, bounds), FASTEST * speed)
        steep = _spread(rise, bounds, len(demand.along))[:, None]
        jerks = _least(jerk_bound(path, limits, fast, crossing_term(path, fast, steep)))
        jerk = np.fmin(_least_in(jerks, bounds), FASTEST * rise)
        require_short(float(np.sum(np.diff(edges) / speed)))
        require_short(math.sqrt(end / float(rise.max())))
    rows = zip(*(column.tolist() for column in (np.diff(edges), speed, rise, jerk)), strict=True)
    sections = [Section(length, v, a, j, bends=True) for length, v, a, j in rows]
    if min(min(section.speed, section.acceleration, section.jerk) for section in sections) <= 0.0:
        raise NoProfile(because("plan.timing.none", length=float(end)))
    return sections


def _least_in(rows: Array, bounds: NDArray[np.int64]) -> Array:
    """(j,) the least of `rows` (m,) in each stretch from a row up to another, both in `bounds` (j, 2)."""
    least: Array = np.fmin.reduceat(rows, bounds.reshape(-1))[::2]
    return least


def _spread(values: Array, bounds: NDArray[np.int64], count: int) -> Array:
    """(m,) for every row what its stretch has; rows between two stretches belong to the one before."""
    stretch = np.searchsorted(bounds[:, 0], np.arange(count), side="right") - 1
    spread: Array = values[np.maximum(stretch, 0)]
    return spread


def _norms(rows: Array) -> Array:
    """(m, 1): the lengths of the rows; 0 where they are empty."""
    return np.asarray(np.linalg.norm(rows, axis=1, keepdims=True))


def _least(values: Array) -> Array:
    """(m,) of each row, what is no number apart."""
    least: Array = np.fmin.reduce(values, axis=1)
    return least
