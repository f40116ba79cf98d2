"""One plan, from request to verified trajectory, in the planner's own core, on fixed random problems in four scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, Goal, NotMeasured, of_samples
from services.bench.plan_references import PlainOmpl, Reference, Roboplan
from services.bench.plan_scenes import SCENES
from services.bench.plan_trials import PHASES, Trial, every_trial, spread
from services.bench.problem_sets import ALLOWED, COUNT, problem_set

UNIT = "ms"
GOAL = Goal(median=2.0, p99=20.0)
REFERENCED = 40  # problems a scene and arm that the references are given too: they take a hundred times as long
REFERENCES: tuple[tuple[str, type[Reference]], ...] = (
    ("OMPL RRTConnect on coal", PlainOmpl),
    ("roboplan RRT-Connect", Roboplan),
)


def measure() -> Figure:
    """Of all problems: each can be solved, so one that is not counts with the time that it took."""
    by_scene = every_trial()
    every = [trial for some in by_scene.values() for trial in some]
    searched = [trial for trial in every if trial.is_searched]
    reference: dict[str, float] = {}
    for name, some in by_scene.items():
        reference |= spread(name, [trial.took for trial in some], 0.5, 0.99)
    reference |= spread("all, CPU time", [trial.worked for trial in every], 0.5, 0.99)
    reference |= split("straight lines", [trial for trial in every if not trial.is_searched])
    reference |= split("searched", searched)
    told = list(references(by_scene, reference))
    note = (
        f"rm1 and parol6, {len(SCENES)} scenes, {COUNT} fixed random problems each (postures and tool poses in turns; "
        f"all can be solved), {ALLOWED:g} s allowed; {len(searched)} of {len(every)} needed a search; references: "
        f"search and simplification alone, the first {REFERENCED} problems a scene, posture to posture; "
        + "; ".join(told)
    )
    return of_samples([trial.took for trial in every], UNIT, GOAL, reference, note)


def split(name: str, some: list[Trial]) -> dict[str, float]:
    """[ms] as a whole, of the CPU, and of every phase that there was."""
    whole = spread(name, [trial.took for trial in some], 0.5, 0.99)
    worked = spread(f"{name}, CPU time", [trial.worked for trial in some], 0.5, 0.99)
    columns = {phase: [trial.phase(phase) for trial in some] for phase in PHASES}
    phases = [spread(f"{name}: {phase}", column, 0.5, 0.99) for phase, column in columns.items() if any(column)]
    return whole | worked | {what: value for phase in phases for what, value in phase.items()}


def references(by_scene: dict[str, list[Trial]], reference: dict[str, float]) -> Iterator[str]:
    """Puts what the others take into `reference`, ours for the same problems beside it; says what cannot be had."""
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
    """[ms] of every problem, and whether it was solved; what was not has taken all its time."""
    took, solved = [], []
    for arm in (rm1(), parol6()):
        for name, scene in SCENES.items():
            planner = kind(arm, scene)
            for index, problem in enumerate(problem_set(arm.name, name).problems[:REFERENCED]):
                answer = planner.solving_ms(problem.start, problem.goal, seed=index)
                took.append(1e3 * ALLOWED if answer is None else answer)
                solved.append(answer is not None)
    return took, solved
