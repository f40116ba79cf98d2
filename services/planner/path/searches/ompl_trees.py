"""The searches of OMPL that grow trees or batches of samples: RRTConnect, RRTstar, BITstar.

What improves for as long as it may is stopped by the count of its own questions, not by the clock, so that the same
seed gives the same path.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.ompl_problem import OmplProblem, configuration_of
from gemelo.services.planner.path.path import PathNotFound, Sought
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import SearchFailure

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
BETTERING = {"RRTstar": 600, "BITstar": 3000}  # questions "are we done?" after the first way
RANGE = 0.4  # [s] at full speed that a tree grows by at most


def corners(sought: Sought, planner_id: str, deadline: Deadline) -> Array:
    """Corners (m, n) [rad] or [m] of the path of a planner that grows trees or batches; raises `PathNotFound`."""
    from ompl import geometric  # slow to load

    problem = OmplProblem(sought)
    planner = getattr(geometric, planner_id)(problem.information)
    if hasattr(planner, "setRange"):
        planner.setRange(RANGE * math.sqrt(len(problem.scale)))
    planner.setProblemDefinition(problem.definition)
    planner.setup()
    is_late = problem.late(deadline)
    is_over = _bettered(planner, BETTERING[planner_id], is_late) if planner_id in BETTERING else is_late
    planner.solve(problem.base.PlannerTerminationCondition(is_over))
    if not problem.definition.hasExactSolution():
        raise PathNotFound(SearchFailure.TIMED_OUT)
    return np.array(
        [configuration_of(state, problem.scale) for state in problem.definition.getSolutionPath().getStates()]
    )


def _bettered(planner: Any, questions: int, is_late: Callable[[], bool]) -> Callable[[], bool]:
    """True when the time is over, or so many questions after the first way; OMPL tells of it at the end only."""
    left = questions

    def is_over() -> bool:
        nonlocal left
        if math.isfinite(planner.bestCost().value()):
            left -= 1
        return left < 0 or bool(is_late())

    return is_over
