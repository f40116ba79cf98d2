"""The same plans in Python alone: OMPL's RRTConnect, and coal for every check, as where the core is not compiled.

In a process of its own, which cannot import the core: `python -m services.bench.plan_python_ms 40` prints what it took.
"""

from __future__ import annotations

import gc
import subprocess
import sys

import msgspec

from services.bench.figure import Figure, Goal, NotMeasured, of_samples
from services.bench.plan_scenes import SCENES

UNIT = "ms"
GOAL = Goal(median=50.0, p99=1000.0)
COUNT = 40  # problems a scene and arm, the first ones of plan_ms
CORE = "services.planner.native.binding"
LONGEST = 400.0  # [s]


class Run(msgspec.Struct, frozen=True):
    """One plan: [ms] of the clock and of the CPU."""

    took: float
    worked: float
    is_solved: bool
    planner_id: str

    @property
    def is_searched(self) -> bool:
        return self.planner_id != "straight"


def measure() -> Figure:
    from services.bench.plan_trials import spread

    runs = in_python_alone(COUNT)
    searched = [run for run in runs if run.is_searched]
    reference = spread("searched", [run.took for run in searched], 0.5, 0.99)
    reference |= spread("searched, CPU time", [run.worked for run in searched], 0.5, 0.99)
    reference["solved %"] = 100.0 * sum(run.is_solved for run in runs) / len(runs)
    note = f"the first {COUNT} problems of each of {len(SCENES)} scenes, both arms; {len(searched)} needed a search"
    return of_samples([run.took for run in runs], UNIT, GOAL, reference, note)


def in_python_alone(count: int) -> list[Run]:
    """Measured by this file as a program."""
    command = [sys.executable, "-m", __spec__.name, str(count)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
    if done.returncode != 0:
        raise NotMeasured(f"the process without the core ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return msgspec.json.decode(done.stdout.splitlines()[-1], type=list[Run])


def main(count: int) -> None:
    """Prints the runs as JSON."""
    sys.modules[CORE] = None  # type: ignore[assignment]  # from now on its import fails
    from services.bench.arms import parol6, rm1
    from services.bench.plan_trials import trials
    from services.planner.core import Planner

    planners = (Planner(rm1()), Planner(parol6()))
    gc.freeze()  # as the planner's workers do
    runs = [
        Run(trial.took, trial.worked, trial.is_solved, trial.response.planner_id)
        for planner in planners
        for name in SCENES
        for trial in trials(planner, name, count)
    ]
    print(msgspec.json.encode(runs).decode())


if __name__ == "__main__":
    main(int(sys.argv[1]))
