"""Figures of whole plans of the fixed problems: with the compiled core, and in Python alone."""

from __future__ import annotations

import gc
import subprocess
import sys
from collections.abc import Iterator, Sequence

import msgspec

from gemelo.services.planner.core import Planner
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, rounded
from gemelo.tools.bench.planner.references import PlainOmpl, Reference, Roboplan
from gemelo.tools.bench.planner.trials import PHASES, Trial, every_trial, spread, trials
from gemelo.tools.bench.problems.problem_sets import ALLOWED, COUNT, problem_set, problem_sets
from gemelo.tools.bench.scenes import SCENES, parol6, rm1

GOAL = FigureGoal(median=2.0, p99=20.0)  # [ms]
REFERENCED = 40  # problems a scene and arm for the references, which take a hundred times as long
REFERENCES: tuple[tuple[str, type[Reference]], ...] = (
    ("OMPL RRTConnect on coal", PlainOmpl),
    ("roboplan RRT-Connect", Roboplan),
)
SUCCESS_GOAL = 100.0  # [%]
NAMED = 12  # failures that the note names


def plan_ms() -> Figure:
    """Time of one plan [ms], over all problems; a problem that is not solved counts with the time spent on it."""
    by_scene = every_trial()
    every = [trial for some in by_scene.values() for trial in some]
    searched = [trial for trial in every if trial.is_searched]
    reference: dict[str, float] = {}
    for name, some in by_scene.items():
        reference |= spread(name, [trial.took for trial in some], 0.5, 0.99)
    reference |= spread("all, CPU time", [trial.worked for trial in every], 0.5, 0.99)
    reference |= split("straight lines", [trial for trial in every if not trial.is_searched])
    reference |= split("searched", searched)
    missing = list(references(by_scene, reference))
    note = (
        f"rm1 and parol6, {len(SCENES)} scenes, {COUNT} fixed random problems each (configurations and tool poses in "
        f"turns; all can be solved), {ALLOWED:g} s allowed; {len(searched)} of {len(every)} needed a search; "
        f"references: search and simplification alone, the first {REFERENCED} problems a scene, configuration to "
        "configuration; " + "; ".join(missing)
    )
    return of_samples([trial.took for trial in every], GOAL, reference, note)


def split(name: str, some: list[Trial]) -> dict[str, float]:
    """Quantiles [ms] of clock time, CPU time and every planning phase that occurred."""
    whole = spread(name, [trial.took for trial in some], 0.5, 0.99)
    worked = spread(f"{name}, CPU time", [trial.worked for trial in some], 0.5, 0.99)
    columns = {phase: [trial.phase(phase) for trial in some] for phase in PHASES}
    phases = [spread(f"{name}: {phase}", column, 0.5, 0.99) for phase, column in columns.items() if any(column)]
    return whole | worked | {what: value for phase in phases for what, value in phase.items()}


def references(by_scene: dict[str, list[Trial]], reference: dict[str, float]) -> Iterator[str]:
    """Adds the times [ms] of the other planners, and ours on the same problems; yields why one is missing."""
    same = [trial for some in by_scene.values() for trial in some[:REFERENCED]]
    reference |= spread("the same problems as the references", [trial.took for trial in same], 0.5, 0.99)
    reference |= spread("the same, our search", [trial.phase("search") for trial in same], 0.5, 0.99)
    for name, kind in REFERENCES:
        try:
            took, solved = reference_ms(kind)
        except NotMeasured as error:
            yield f"{name}: not measured: {error}"
            continue
        reference |= spread(name, took, 0.5, 0.99)
        reference[f"{name}, solved %"] = 100.0 * sum(solved) / len(solved)


def reference_ms(kind: type[Reference]) -> tuple[Sequence[float], Sequence[bool]]:
    """Time [ms] of every problem, all the allowed time for one that is not solved; and True for each solved one."""
    took, solved = [], []
    for arm in (rm1(), parol6()):
        for name, scene in SCENES.items():
            planner = kind(arm, scene)
            for index, problem in enumerate(problem_set(arm.name, name).problems[:REFERENCED]):
                answer = planner.shortened_path(problem.start, problem.goal, seed=index)
                took.append(1e3 * ALLOWED if answer is None else answer.took)
                solved.append(answer is not None)
    return took, solved


def plan_success() -> Figure:
    """Share [%] of the problems solved in the allowed time; the references are the shares of each scene."""
    by_scene = every_trial()
    failures = [
        f"{name} {index} ({trial.response.code.name})"
        for name, some in by_scene.items()
        for index, trial in enumerate(some)
        if not trial.is_solved
    ]
    count = sum(len(some) for some in by_scene.values())
    share = rounded(100.0 * (1.0 - len(failures) / count))
    left_out = sum(each.drawn - len(each.problems) for each in problem_sets())
    note = (
        f"{len(failures)} of {count} problems not solved in {ALLOWED:g} s: {', '.join(failures[:NAMED]) or 'none'}; "
        f"{left_out} more pairs of configurations were drawn and left out: no path between them is known"
    )
    reference = {
        name: rounded(100.0 * sum(trial.is_solved for trial in some) / len(some)) for name, some in by_scene.items()
    }
    return Figure(
        median=share, p99=share, goal=f">= {SUCCESS_GOAL:g}", met=not failures, reference=reference, note=note
    )


PYTHON_GOAL = FigureGoal(median=50.0, p99=1000.0)  # [ms]
PYTHON_COUNT = 40  # problems a scene and arm, the first ones of plan_ms
PYTHON_TIMEOUT = 400.0  # [s]
# The core's import fails in this process, as where it is not compiled: OMPL searches and coal checks everything.
PROGRAM = """
import sys
sys.modules["gemelo.services.planner.native.binding"] = None
from gemelo.tools.bench.planner.planning import print_runs
print_runs(int(sys.argv[1]), float(sys.argv[2]))
"""


class PythonRun(msgspec.Struct, frozen=True):
    """One plan in Python alone."""

    took: float  # [ms] of the clock
    worked: float  # [ms] of the CPU
    is_solved: bool
    planner_id: str


def plan_python_ms() -> Figure:
    """Time of one plan [ms] without the compiled core: OMPL's RRTConnect, and coal for every check."""
    runs = runs_without_core(PYTHON_COUNT)
    searched = [run for run in runs if run.planner_id != "straight"]
    reference = spread("searched", [run.took for run in searched], 0.5, 0.99)
    reference |= spread("searched, CPU time", [run.worked for run in searched], 0.5, 0.99)
    reference["solved %"] = 100.0 * sum(run.is_solved for run in runs) / len(runs)
    note = (
        f"the first {PYTHON_COUNT} problems of each of {len(SCENES)} scenes, both arms; {len(searched)} needed a search"
    )
    return of_samples([run.took for run in runs], PYTHON_GOAL, reference, note)


def runs_without_core(count: int, allowed: float = ALLOWED) -> list[PythonRun]:
    """The first `count` problems of each scene, planned in a process without the core, `allowed` [s] each."""
    command = [sys.executable, "-c", PROGRAM, str(count), str(allowed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PYTHON_TIMEOUT)
    if done.returncode != 0:
        raise NotMeasured(f"the process without the core ended with {done.returncode}: {done.stderr.strip()[-300:]}")
    return msgspec.json.decode(done.stdout.splitlines()[-1], type=list[PythonRun])


def print_runs(count: int, allowed: float) -> None:
    """Plans the first `count` problems of each scene in `allowed` [s] each, and prints the runs as JSON."""
    planners = (Planner(rm1()), Planner(parol6()))
    gc.freeze()  # as the planner's workers do
    runs = [
        PythonRun(trial.took, trial.worked, trial.is_solved, trial.response.planner_id)
        for planner in planners
        for name in SCENES
        for trial in trials(planner, name, count, allowed=allowed)
    ]
    print(msgspec.json.encode(runs).decode())
