"""Every fixed problem, planned once from request to verified trajectory, for all figures that are about plans."""

from __future__ import annotations

import gc
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from schemas.motion import JointTrajectory
from schemas.planning import PlanningTimes, PlanResponse
from services.bench.arms import parol6, rm1
from services.bench.figure import quantile
from services.bench.plan_scenes import SCENES
from services.bench.problem_sets import COUNT, Problem, problem_set, request_of
from services.planner.collision.world import World
from services.planner.core import Planner

Array = NDArray[np.float64]

PHASES = PlanningTimes.__struct_fields__
WARMING = 2  # problems that are planned before, for what is built when it is needed first


@dataclass(frozen=True)
class Trial:
    """One problem: how long it took, of the clock and of the CPU [ms], and what came out."""

    problem: Problem
    took: float
    worked: float
    response: PlanResponse  # without the trajectory: thousands of them are kept
    path: Array  # (m, n) the positions of its points

    @property
    def is_solved(self) -> bool:
        return self.response.refusal is None

    @property
    def is_searched(self) -> bool:
        """Whether the straight line of the joints would not do."""
        return self.response.planner_id != "straight"

    def phase(self, name: str) -> float:
        """[ms]"""
        return 1e3 * float(getattr(self.response.times, name))


@cache
def every_trial() -> dict[str, list[Trial]]:
    """By arm and scene."""
    by_scene: dict[str, list[Trial]] = {}
    for arm in (rm1(), parol6()):
        planner = Planner(arm)
        planner.prepare()
        gc.freeze()  # as the planner's workers do
        for name in SCENES:
            by_scene[f"{arm.name} {name}"] = trials(planner, name)
        gc.unfreeze()
    return by_scene


def trials(planner: Planner, name: str, count: int = COUNT, planner_id: str = "") -> list[Trial]:
    """The first problems of one scene."""
    planner.set_world(World(planner.arm, planner.kinematics, SCENES[name]))
    chosen = problem_set(planner.arm.name, name).problems[:count]
    for problem in chosen[:WARMING]:
        trial(planner, problem, planner_id)
    return [trial(planner, problem, planner_id) for problem in chosen]


def trial(planner: Planner, problem: Problem, planner_id: str) -> Trial:
    request = request_of(problem, planner.arm, planner.kinematics, planner_id)
    began, before = time.perf_counter(), time.process_time()
    response = planner.plan(request, None, clock=time.perf_counter)
    took, worked = (time.perf_counter() - began) * 1e3, (time.process_time() - before) * 1e3
    path = np.array([point.positions for point in response.trajectory.points])
    return Trial(problem, took, worked, msgspec.structs.replace(response, trajectory=JointTrajectory()), path)


def spread(name: str, values: Sequence[float], *shares: float) -> dict[str, float]:
    """Quantiles under `name`, as references have them; nothing where there are no values."""
    return {f"{name}, p{100 * share:.0f}": quantile(values, share) for share in shares if values}
