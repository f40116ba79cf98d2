"""How many of the fixed problems the planner solves in the second that it is allowed; each of them can be solved."""

from __future__ import annotations

from services.bench.figure import Figure, rounded
from services.bench.plan_trials import every_trial
from services.bench.problem_sets import ALLOWED, problem_sets

UNIT = "%"
GOAL = 100.0
NAMED = 12  # failures that are told by name


def measure() -> Figure:
    """The references are of each scene."""
    by_scene = every_trial()
    failures = [
        f"{name} {index} ({trial.response.code.name})"
        for name, some in by_scene.items()
        for index, trial in enumerate(some)
        if not trial.is_solved
    ]
    count = sum(len(some) for some in by_scene.values())
    share = 100.0 * (1.0 - len(failures) / count)
    left_out = sum(each.drawn - len(each.problems) for each in problem_sets())
    note = (
        f"{len(failures)} of {count} problems not solved in {ALLOWED:g} s: {', '.join(failures[:NAMED]) or 'none'}; "
        f"{left_out} more pairs of postures were drawn and left out, for which nothing finds a way"
    )
    return Figure(
        unit=UNIT,
        median=rounded(share),
        p99=rounded(share),
        goal=f">= {GOAL:g}",
        met=not failures,
        reference={
            name: rounded(100.0 * sum(trial.is_solved for trial in some) / len(some)) for name, some in by_scene.items()
        },
        note=note,
    )
