"""States along timed paths, from rest to rest, so near that the quintics between them keep to the path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.path_curve import PathCurve
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.timing.path_timing import Law
from gemelo.services.planner.timing.profile import MOST_POINTS, States
from gemelo.services.planner.verification.verify import Samples, sample_between

Array = NDArray[np.float64]
Error = Callable[[float, Array], float]  # [m] that the configuration (n,) at a length is off the path

# Tuning constants: chosen, where a line does not say measured or standard.
SPACING = 0.04  # [s] between points, before it is halved where that is too much
HALVINGS = 6  # chosen: to 1/64 of the spacing, 0.6 ms, below a slot of the device
OFF = 5e-5  # [m] by which the finished motion may leave the path
SURE = 3e-5  # [m] by which it may leave the curve, which is nearly the path, without being looked at


@dataclass(frozen=True)
class Run:
    """A path from rest to rest: its curve, whose first columns are the joints, and when it is where."""

    curve: PathCurve
    law: Law
    start: Array  # (n,) exact
    end: Array  # (n,) exact
    marks: Array = field(default_factory=lambda: np.empty(0))  # lengths inside at which there is to be a point
    error: Error | None = None  # absent: any quintic through the points will do
    reach: Array | None = None  # (n,) [m] that the tool moves at most per unit of a joint


def states_of_runs(runs: Sequence[Run], deadline: Deadline) -> States:
    """One run after the other, at rest between them; every end is exact to the bit. Raises `PlanRefused` if it is
    late."""
    parts: list[States] = []
    clock = 0.0
    for run in runs:
        states = _near_enough(run, deadline)
        states = states._replace(times=states.times + clock)
        clock = float(states.times[-1])
        parts.append(States(*(column[1:] for column in states)) if parts else states)
    return States(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def between(states: States, parts: int) -> Samples:
    """Rows inside every segment, where its `parts` meet."""
    samples = sample_between(*states, parts)
    row = np.arange(len(samples.times)) % (parts + 1)
    inside = (row > 0) & (row < parts)
    return Samples(*(getattr(samples, field.name)[inside] for field in fields(samples)))


def _near_enough(run: Run, deadline: Deadline) -> States:
    """With points so dense that what is executed is not off the path."""
    most = max(MOST_POINTS, len(run.marks))  # wider apart they would not follow what is between the marks
    times = run.law.times(run.marks, max(SPACING, run.law.duration / most))
    states, doubtful = _states(run, times), np.arange(len(times) - 1)
    for _ in range(HALVINGS):
        bad = doubtful if run.error is None else _off(run, states, doubtful, deadline)
        if run.error is None or not len(bad):
            break
        states = _states(run, np.insert(states.times, bad + 1, 0.5 * (states.times[bad] + states.times[bad + 1])))
        halves = bad + np.arange(len(bad))
        doubtful = np.column_stack((halves, halves + 1)).reshape(-1)
    return states


def _off(run: Run, states: States, segments: NDArray[np.int64], deadline: Deadline) -> NDArray[np.int64]:
    """Those of the segments that leave the path.

    Two quintics that agree in position, velocity and acceleration at both ends are farthest apart in the middle.
    """
    assert run.error is not None
    middles = between(states, 2)
    lengths, _, _ = run.law.at(middles.times[segments])
    if run.reach is not None:
        strays = np.abs(run.curve.at(lengths).value[:, : len(run.start)] - middles.positions[segments]) @ run.reach
        segments, lengths = segments[strays > SURE], lengths[strays > SURE]
    off = []
    for segment, length in zip(segments.tolist(), lengths.tolist(), strict=True):
        deadline.check()
        off.append(run.error(length, middles.positions[segment]) > OFF)
    return np.asarray(segments[np.array(off, dtype=bool)])


def _states(run: Run, times: Array) -> States:
    lengths, speeds, rises = run.law.at(times)
    derivatives, joints = run.curve.at(lengths), len(run.start)
    speed, rise = speeds[:, None], rises[:, None]
    positions, velocities = derivatives.value[:, :joints].copy(), (derivatives.first * speed)[:, :joints]
    accelerations = (derivatives.second * speed**2 + derivatives.first * rise)[:, :joints]
    positions[0], positions[-1] = run.start, run.end
    velocities[[0, -1]] = accelerations[[0, -1]] = 0.0
    return States(times, positions, velocities, accelerations)
