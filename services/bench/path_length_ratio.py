"""How long the planner's ways are, against the shortest that long runs have found for the same problems.

Lengths are times at full speed, measured as in space: what the searches shorten. `known_ways` says how the shortest
ones were found; `problem_sets.json` has them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, NotMeasured, of_samples, rounded
from services.bench.plan_trials import Trial, every_trial, spread
from services.bench.problem_sets import way_length

Array = NDArray[np.float64]

UNIT = "ratio"


def measure() -> Figure:
    """Of the solved problems for which the straight line of the joints would not do."""
    speeds = {arm.name: np.array([joint.velocity for joint in arm.joints]) for arm in (rm1(), parol6())}
    rows = [
        (ratio(trial, speeds[name.split()[0]]), name, index, trial.is_searched)
        for name, some in every_trial().items()
        for index, trial in enumerate(some)
        if trial.is_solved
    ]
    searched = sorted(row for row in rows if row[3])
    if not searched:
        raise NotMeasured("no way had to be searched for")
    reference: dict[str, float] = {}
    for name in every_trial():
        reference |= spread(name, [row[0] for row in searched if row[1] == name], 0.5, 0.9)
    reference |= spread("searched", [row[0] for row in searched], 0.9)
    reference |= spread("straight lines too", [row[0] for row in rows], 0.5, 0.9)
    longest, where, index, _ = searched[-1]
    note = (
        f"{len(searched)} ways that had to be searched for, of {len(rows)}; the longest is {rounded(longest)} times "
        f"as long as the best known ({where} {index}), the shortest {rounded(searched[0][0])} times"
    )
    return of_samples([row[0] for row in searched], UNIT, None, reference, note)


def ratio(trial: Trial, speeds: Array) -> float:
    return way_length(trial.path, speeds) / trial.problem.length
