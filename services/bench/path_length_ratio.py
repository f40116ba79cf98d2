"""How long the planner's ways are, against the shortest that long runs have found for the same problems.

Lengths are times at full speed, measured as in space: what the searches shorten. `known_ways` says how the shortest
ones were found; `problem_sets.json` has them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, of_samples, rounded
from services.bench.plan_trials import Trial, every_trial, spread
from services.bench.problem_sets import way_length

Array = NDArray[np.float64]

UNIT = "ratio"


def measure() -> Figure:
    """Of the solved problems for which the straight line of the joints would not do."""
    speeds = {arm.name: np.array([joint.velocity for joint in arm.joints]) for arm in (rm1(), parol6())}
    by_scene = {
        name: [(trial, ratio(trial, speeds[name.split()[0]])) for trial in some if trial.is_solved]
        for name, some in every_trial().items()
    }
    reference: dict[str, float] = {}
    for name, some in by_scene.items():
        reference |= spread(name, [share for trial, share in some if trial.is_searched], 0.5, 0.9)
    every = [pair for some in by_scene.values() for pair in some]
    searched = [share for trial, share in every if trial.is_searched]
    reference |= spread("searched", searched, 0.9)
    reference |= spread("straight lines too", [share for _, share in every], 0.5, 0.9)
    note = (
        f"{len(searched)} ways that had to be searched for, of {len(every)}; the longest is "
        f"{rounded(max(searched))} times as long as the best known, the shortest {rounded(min(searched))} times"
    )
    return of_samples(searched, UNIT, None, reference, note)


def ratio(trial: Trial, speeds: Array) -> float:
    return way_length(trial.path, speeds) / trial.problem.length
