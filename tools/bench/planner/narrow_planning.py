"""The figure of plans through narrow passages for generated arms that do not ship, with other planners on the same
problems."""

from __future__ import annotations

import msgspec

from gemelo.services.planner.core import Planner
from gemelo.tools.bench.any_arm.generated_arms import generated_arm
from gemelo.tools.bench.any_arm.narrow_families import NARROW
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile
from gemelo.tools.bench.planner.any_planning import (
    OMPL,
    ROBOPLAN,
    AnyTrial,
    length_ratios,
    ratio_to_roboplan,
    rounded_all,
    trials_of,
)
from gemelo.tools.bench.planner.trials import spread

ARMS = ("six", "seven", "eight")
MEDIAN_GOAL, P99_GOAL = 0.03, 0.01  # of roboplan's search and shortcutting, without timing or verification
TAIL_GOAL = 10.0  # times the p50 that the p99 is at most


def plan_narrow_ms(count: int) -> Figure:
    """CPU time of one plan [ms], request to verified trajectory, of the first `count` problems of each arm and narrow
    family that any planner solves; the references only search and shorten."""
    by_name = {
        f"{name} {family}": trials
        for name in ARMS
        for family, trials in trials_of(Planner(generated_arm(name)), count, NARROW).items()
    }
    every = [trial for some in by_name.values() for trial in some if trial.is_possible]
    if not every:
        raise NotMeasured("no planner has solved any problem")
    worked = [trial.worked for trial in every]
    failed = [trial for trial in every if not trial.is_solved or trial.has_contact]
    ratios = {share: ratio_to_roboplan(every, share) for share in (0.5, 0.99)}
    tail = quantile(worked, 0.99) / quantile(worked, 0.5)
    reference = {f"of roboplan's, p{100 * share:.0f}": ratio for share, ratio in ratios.items()}
    reference |= {"p99 over p50": tail, "contacts": float(sum(trial.has_contact for trial in every))}
    reference |= {"solved %": 100.0 * (1.0 - len(failed) / len(every))}
    for name in (OMPL, ROBOPLAN):
        reference |= {f"{name}, solved %": 100.0 * sum(each.others[name] is not None for each in every) / len(every)}
        reference |= spread(name, [trial.spent_by(name) for trial in every], 0.5, 0.99)
    reference |= _by_family(by_name)
    figure = of_samples(worked, None, rounded_all(reference), _note(by_name, failed, count))
    is_met = ratios[0.5] <= MEDIAN_GOAL and ratios[0.99] <= P99_GOAL and tail <= TAIL_GOAL and not failed
    goal = (
        f"p50 <= {MEDIAN_GOAL:g}, p99 <= {P99_GOAL:g} of roboplan's; p99 <= {TAIL_GOAL:g} p50; all solved, no contact"
    )
    return msgspec.structs.replace(figure, goal=goal, met=is_met)


def _by_family(by_name: dict[str, list[AnyTrial]]) -> dict[str, float]:
    """Times [ms], and lengths over the best known, of one arm in one family."""
    reference: dict[str, float] = {}
    for name, some in by_name.items():
        possible = [trial for trial in some if trial.is_possible]
        reference |= spread(name, [trial.worked for trial in possible], 0.5, 0.99)
        reference |= spread(f"{name}: length over the best known", list(length_ratios(possible)), 0.5, 0.9)
    return reference


def _note(by_name: dict[str, list[AnyTrial]], failed: list[AnyTrial], count: int) -> str:
    named = ", ".join(f"{each.problem.arm} {each.problem.family} {each.problem.seed}" for each in failed)
    impossible = sum(not trial.is_possible for some in by_name.values() for trial in some)
    return (
        f"{', '.join(ARMS)}: {', '.join(NARROW)}, {count} drawn problems each, every other one asks for a pose; CPU "
        f"time; not solved: {named or 'none'}; {impossible} more that no planner solves"
    )
