"""Every fixed problem planned once, from request to verified trajectory: the samples of all figures about plans."""

from __future__ import annotations

import gc
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import PlanningTimes, PlanResponse
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.figures import quantile
from gemelo.tools.bench.problems.problem_sets import ALLOWED, COUNT, PlanningProblem, problem_set, request_of
from gemelo.tools.bench.scenes import SCENES, parol6, rm1

Array = NDArray[np.float64]

PHASES = PlanningTimes.__struct_fields__
WARMING = 2  # problems planned beforehand: some tables are built when first used


@dataclass(frozen=True)
class Trial:
    """One planned problem."""

    problem: PlanningProblem
    took: float  # [ms] of the clock
    worked: float  # [ms] of the CPU
    response: PlanResponse  # without its trajectory, to save memory
    path: Array  # (m, n) positions [rad] or [m] of the trajectory's points

    @property
    def is_solved(self) -> bool:
        """True if the planner has not refused it."""
        return self.response.refusal is None

    @property
    def is_searched(self) -> bool:
        """True if the straight joint path was not free, so that a path was searched for."""
        return self.response.planner_id != "straight"

    def phase(self, name: str) -> float:
        """Duration [ms] of the planning phase `name`, one of PHASES."""
        return 1e3 * float(getattr(self.response.times, name))


@cache
def every_trial() -> dict[str, list[Trial]]:
    """All trials by "<arm> <scene>", planned on the first call."""
    by_scene: dict[str, list[Trial]] = {}
    for arm in (rm1(), parol6()):
        planner = Planner(arm)
        planner.prepare()
        gc.freeze()  # as the planner's workers do
        for name in SCENES:
            by_scene[f"{arm.name} {name}"] = trials(planner, name)
        gc.unfreeze()
    return by_scene


def trials(
    planner: Planner, name: str, count: int = COUNT, planner_id: str = "", allowed: float = ALLOWED
) -> list[Trial]:
    """The first `count` problems of the scene `name`, with `allowed` [s] for each."""
    planner.set_world(World(planner.arm, planner.kinematics, SCENES[name]))
    chosen = problem_set(planner.arm.name, name).problems[:count]
    for problem in chosen[:WARMING]:
        trial(planner, problem, planner_id, allowed)
    return [trial(planner, problem, planner_id, allowed) for problem in chosen]


def trial(planner: Planner, problem: PlanningProblem, planner_id: str, allowed: float = ALLOWED) -> Trial:
    """Plans one problem within `allowed` [s]."""
    request = request_of(problem, planner.arm, planner.kinematics, planner_id, allowed)
    began, before = time.perf_counter(), time.process_time()
    response = planner.plan(request, None, clock=time.perf_counter)
    took, worked = (time.perf_counter() - began) * 1e3, (time.process_time() - before) * 1e3
    path = np.array([point.positions for point in response.trajectory.points])
    return Trial(problem, took, worked, msgspec.structs.replace(response, trajectory=JointTrajectory()), path)


def spread(name: str, values: Sequence[float], *shares: float) -> dict[str, float]:
    """Quantiles of `values`, in their unit, by "<name>, p<percent>", the form of a figure's references; `shares` are 0
    to 1. Empty without values."""
    return {f"{name}, p{100 * share:.0f}": quantile(values, share) for share in shares if values}
