"""Figures of plans for generated arms that do not ship, by arm and family, with other planners on the same problems."""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import PlanResponse
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.native.paths import FreePath
from gemelo.services.planner.verification.verify import at_times
from gemelo.tools.bench.any_arm.drawn_problems import DrawnProblem, problems
from gemelo.tools.bench.any_arm.families import FAMILIES, Family
from gemelo.tools.bench.any_arm.generated_arms import ARMS, generated_arm
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile, rounded
from gemelo.tools.bench.planner.references import CoalChecker, PlainOmpl, Reference, ReferenceResult, Roboplan
from gemelo.tools.bench.planner.trials import PHASES, WARMING, spread
from gemelo.tools.bench.problems.problem_sets import ALLOWED, path_length

Array = NDArray[np.float64]

OMPL, ROBOPLAN = "OMPL", "roboplan"
REFERENCES: dict[str, type[Reference]] = {OMPL: PlainOmpl, ROBOPLAN: Roboplan}
MEDIAN_GOAL, P99_GOAL = 1.0 / 20.0, 1.0 / 10.0  # of roboplan's search and shortcutting, without timing or verification
SUCCESS_GOAL = 99.5  # [%] of what any planner solves
SAMPLED = 0.002  # [rad] that a joint moves at most between two configurations that are looked at for contacts
LENGTH_SEEDS = 24  # searches for the best known path
SHORTEST = 1e-3  # [s] at full speed: no ratio is made of shorter ways
NAMED = 12  # failures that the note names


@dataclass(frozen=True)
class AnyTrial:
    """One problem, planned by all."""

    problem: DrawnProblem
    worked: float  # [ms] of the CPU, from the request to the verified trajectory
    intake: float  # [ms] of the CPU, to take in the scene beforehand
    response: PlanResponse  # without its trajectory, to save memory
    has_contact: bool  # on the exact shapes, `SAMPLED` apart
    length: float  # [s at full speed]
    best: float  # [s at full speed] of the shortest path known
    others: dict[str, ReferenceResult | None]

    @property
    def is_solved(self) -> bool:
        """True if the planner has not refused it."""
        return self.response.refusal is None

    @property
    def is_possible(self) -> bool:
        """True if any planner has solved it."""
        return self.is_solved or any(answer is not None for answer in self.others.values())

    def spent_by(self, name: str) -> float:
        """[ms] of the CPU that a reference took; all that was allowed where it found nothing."""
        answer = self.others[name]
        return 1e3 * ALLOWED if answer is None else answer.worked


def plan_any_ms(count: int) -> Figure:
    """CPU time of one plan [ms], request to verified trajectory, of the first `count` problems of each arm and family;
    the references only search and shorten."""
    by_name = every_trial(count)
    every = [trial for some in by_name.values() for trial in some if trial.is_possible]
    reference: dict[str, float] = {}
    for name in REFERENCES:
        reference |= spread(name, [trial.spent_by(name) for trial in every], 0.5, 0.99)
    ratios = {share: ratio_to_roboplan(every, share) for share in (0.5, 0.99)}
    reference |= {f"of roboplan's, p{100 * share:.0f}": ratio for share, ratio in ratios.items()}
    for phase in PHASES:
        column = [1e3 * float(getattr(trial.response.times, phase)) for trial in every]
        reference |= spread(phase, column, 0.5, 0.99)
    reference |= spread("the scene taken in before", [trial.intake for trial in every], 0.5, 0.99)
    for name, some in by_name.items():
        reference |= _by_family(name, [trial for trial in some if trial.is_possible])
    figure = of_samples([trial.worked for trial in every], None, reference, _note(by_name, count))
    is_met = ratios[0.5] <= MEDIAN_GOAL and ratios[0.99] <= P99_GOAL
    goal = f"p50 <= {MEDIAN_GOAL:g}, p99 <= {P99_GOAL:g} of roboplan's"
    return msgspec.structs.replace(figure, goal=goal, met=is_met)


def plan_any_success(count: int) -> Figure:
    """Share [%] solved of the problems that any planner solves, of the first `count` of each arm and family; a
    trajectory with a contact is no solution."""
    by_name = every_trial(count)
    every = [trial for some in by_name.values() for trial in some if trial.is_possible]
    if not every:
        raise NotMeasured("no planner has solved any problem")
    failed = [trial for trial in every if not trial.is_solved or trial.has_contact]
    share = rounded(100.0 * (1.0 - len(failed) / len(every)))
    reference: dict[str, float] = {"contacts": float(sum(trial.has_contact for trial in every))}
    for name in REFERENCES:
        reference[name] = 100.0 * sum(trial.others[name] is not None for trial in every) / len(every)
    for name, some in by_name.items():
        possible = [trial for trial in some if trial.is_possible]
        reference[name] = 100.0 * sum(trial.is_solved for trial in possible) / max(1, len(possible))
        reference |= spread(f"{name}: length over the best known", list(length_ratios(possible)), 0.5, 0.9)
    named = ", ".join(f"{each.problem.arm} {each.problem.family} {each.problem.seed}" for each in failed[:NAMED])
    impossible = sum(not trial.is_possible for some in by_name.values() for trial in some)
    note = f"not solved: {named or 'none'}; {impossible} more that no planner solves"
    met = share >= SUCCESS_GOAL and not reference["contacts"]
    goal = f">= {SUCCESS_GOAL:g}, no contact"
    return Figure(median=share, p99=share, goal=goal, met=met, reference=rounded_all(reference), note=note)


def ratio_to_roboplan(some: Sequence[AnyTrial], share: float) -> float:
    """Ours over roboplan's quantile of the CPU time, at a `share` of 0 to 1 of the problems; dimensionless."""
    ours, theirs = [trial.worked for trial in some], [trial.spent_by(ROBOPLAN) for trial in some]
    return quantile(ours, share) / quantile(theirs, share)


def _by_family(name: str, some: Sequence[AnyTrial]) -> dict[str, float]:
    """Quantiles [ms] of one arm in one family: ours, and roboplan's."""
    ours = spread(name, [trial.worked for trial in some], 0.5, 0.99)
    return ours | spread(f"{name}, {ROBOPLAN}", [trial.spent_by(ROBOPLAN) for trial in some], 0.5, 0.99)


def length_ratios(some: Sequence[AnyTrial]) -> Iterator[float]:
    """Of each path that is no mere point: its length over that of the best known; dimensionless."""
    return (trial.length / trial.best for trial in some if trial.is_solved and trial.best > SHORTEST)


def _note(by_name: dict[str, list[AnyTrial]], count: int) -> str:
    every = [trial for some in by_name.values() for trial in some]
    lines = sum(trial.response.planner_id == "straight" for trial in every)
    return (
        f"{', '.join(ARMS)}: {len(FAMILIES)} families, {count} drawn problems each, every other one asks for a pose "
        f"(the references always for joint values), {ALLOWED:g} s allowed; CPU time; {lines} of {len(every)} by a "
        "straight line of the joints"
    )


def rounded_all(reference: dict[str, float]) -> dict[str, float]:
    """The values, in their units, each to four significant digits; dimensionless where they are ratios."""
    return {name: rounded(value) for name, value in reference.items()}


@cache
def every_trial(count: int) -> dict[str, list[AnyTrial]]:
    """The first `count` problems by "<arm> <family>", planned on the first call."""
    return {
        f"{name} {family}": trials
        for name in ARMS
        for family, trials in trials_of(Planner(generated_arm(name)), count).items()
    }


def trials_of(planner: Planner, count: int, families: Mapping[str, Family] = FAMILIES) -> dict[str, list[AnyTrial]]:
    """The first `count` problems of each family for one arm."""
    planner.prepare()
    gc.freeze()  # as the planner's workers do
    by_family = {family: problems(planner.arm, planner.kinematics, family, count, families) for family in families}
    for some in by_family.values():
        for problem in some[:WARMING]:
            planned(planner, problem)
    trials = {family: [trial(planner, problem) for problem in some] for family, some in by_family.items()}
    gc.unfreeze()
    return trials


def planned(planner: Planner, problem: DrawnProblem) -> tuple[PlanResponse, float, float]:
    """The response, and the times of the CPU [ms] for the plan and for taking in the scene."""
    began = time.process_time()
    planner.set_world(World(planner.arm, planner.kinematics, problem.setting.scene))
    planner.prepare()
    ready = time.process_time()
    response = planner.plan(problem.request(planner.arm, planner.kinematics), None, clock=time.perf_counter)
    return response, (time.process_time() - ready) * 1e3, (ready - began) * 1e3


def trial(planner: Planner, problem: DrawnProblem) -> AnyTrial:
    """The problem, planned by all."""
    response, worked, intake = planned(planner, problem)
    others = {
        name: kind(planner.arm, problem.setting.scene).shortened_path(problem.start, problem.goal, seed=problem.seed)
        for name, kind in REFERENCES.items()
    }
    path = np.array([point.positions for point in response.trajectory.points])
    speeds = np.array([joint.velocity for joint in planner.arm.joints])
    length = path_length(path, speeds) if len(path) else 0.0
    goal = path[-1] if len(path) else np.array(problem.goal)
    return AnyTrial(
        problem,
        worked,
        intake,
        msgspec.structs.replace(response, trajectory=JointTrajectory()),
        has_contact(planner, problem, response.trajectory),
        length,
        best_known(planner, problem, goal, speeds, [length] if len(path) else []),
        others,
    )


def has_contact(planner: Planner, problem: DrawnProblem, trajectory: JointTrajectory) -> bool:
    """True if pinocchio and coal see a contact anywhere on the trajectory, `SAMPLED` apart; False for an empty one."""
    if not trajectory.points:
        return False
    fastest = max(joint.velocity for joint in planner.arm.joints)
    duration = trajectory.points[-1].time_from_start
    times = np.linspace(0.0, duration, 2 + math.ceil(duration * fastest / SAMPLED))
    rows = at_times(trajectory, times).positions
    moved = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(rows, axis=0)).max(axis=1))))
    kept = np.searchsorted(moved, np.arange(0.0, moved[-1], SAMPLED))  # where it is slow, fewer will do
    checker = CoalChecker(planner.arm, problem.setting.scene)
    return not all(checker.is_free(row) for row in (*rows[kept], rows[-1]))


def best_known(planner: Planner, problem: DrawnProblem, goal: Array, speeds: Array, known: list[float]) -> float:
    """Length [s at full speed] of the shortest path to `goal` (n,) [rad] that many searches find; infinite where none
    does."""
    core = planner.checker.native(planner.arm.clearance)
    if core is not None:
        for seed in range(LENGTH_SEEDS if known else 0):
            path = core.plan(problem.start, goal, seed=seed, time_limit=ALLOWED)
            if isinstance(path, FreePath):
                known.append(path_length(path.corners, speeds))
    return min(known, default=math.inf)
