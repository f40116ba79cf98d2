"""The sampling planners of OMPL 2.0: one thread, seeded, asked for a path in the time that is left.

Distances are counted in time at full speed. What improves for as long as it may is stopped by the count of its own
questions, not by the clock, so that the same seed gives the same path.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.path.path import PathNotFound
from gemelo.services.planner.path.roadmap import shortest_path
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline, endless
from gemelo.services.planner.request.refusals import SearchFailure

Array = NDArray[np.float64]

PLANNERS = ("RRTConnect", "RRTstar", "BITstar", "PRM")
# Tuning constants: chosen, where a line does not say measured or standard.
BETTERING = {"RRTstar": 600, "BITstar": 3000}  # questions "are we done?" after the first way
RANGE = 0.4  # [s] at full speed that a tree grows by at most
BATCH = 60  # "are we done?" while the roadmap grows, until it is looked at
SEEDS = 2**32 - 2  # standard: OMPL takes 32 bits, and 0 means any
AROUND = math.pi  # [rad] about start and goals that a joint without limits is searched in


def ompl_corners(
    arm: ArmDescription,
    planner_id: str,
    start: Array,
    goals: Array,
    validity: ValidityChecker,
    seed: int,
    deadline: Deadline,
) -> Array:
    """Corners (m, n) [rad] or [m] of a polyline from `start` (n,) to one of `goals` (k, n), exact at both ends; raises
    `PathNotFound`."""
    problem = _Problem(arm, validity, np.vstack((start, goals)))
    problem.set_ends(start, goals, seed)
    corners = problem.roadmap(deadline) if planner_id == "PRM" else problem.tree(planner_id, deadline)
    nearest = int(np.argmin(np.abs(goals - corners[-1]).max(axis=1)))
    corners[0], corners[-1] = start, goals[nearest]
    return corners


def load_ompl() -> None:
    """Now, what the first search would wait for."""
    from ompl import base, geometric, util  # noqa: F401

    _motions_class()


class _Problem:
    """One question in OMPL's terms; states are joint values divided by the speed limits."""

    def __init__(self, arm: ArmDescription, validity: ValidityChecker, ends: Array) -> None:
        from ompl import base  # slow to load

        self._scale = np.array([joint.velocity for joint in arm.joints])
        self._validity = validity
        self._base: Any = base
        space = base.RealVectorStateSpace(len(arm.joints))
        bounds = base.RealVectorBounds(len(arm.joints))
        for index, (joint, column) in enumerate(zip(arm.joints, ends.T, strict=True)):
            low, high = float(column.min()) - AROUND, float(column.max()) + AROUND
            bounds.setLow(index, (joint.lower if math.isfinite(joint.lower) else low) / joint.velocity)
            bounds.setHigh(index, (joint.upper if math.isfinite(joint.upper) else high) / joint.velocity)
        space.setBounds(bounds)
        self.information: Any = base.SpaceInformation(space)
        self.information.setStateValidityChecker(_states(validity, self._scale))
        self.information.setMotionValidator(_motions(self.information, validity, self._scale))
        self.information.setup()

    def set_ends(self, start: Array, goals: Array, seed: int) -> None:
        """Sets `start` (n,) and `goals` (k, n) [rad] or [m]; from here on OMPL's random numbers begin anew."""
        from ompl import util  # slow to load

        util.noOutputHandler()
        util.RNG.setSeed(seed % SEEDS + 1)
        self.start, self.goals = start, goals
        self._definition: Any = self._base.ProblemDefinition(self.information)
        self._definition.addStartState(self._state(start))
        ends = self._base.GoalStates(self.information)
        for goal in goals:
            ends.addState(self._state(goal))
        self._definition.setGoal(ends)
        self._definition.setOptimizationObjective(self._base.PathLengthOptimizationObjective(self.information))

    def tree(self, planner_id: str, deadline: Deadline) -> Array:
        """Corners (m, n) [rad] or [m] of the path of a planner that grows trees or batches; raises `PathNotFound`."""
        from ompl import geometric  # slow to load

        planner = getattr(geometric, planner_id)(self.information)
        if hasattr(planner, "setRange"):
            planner.setRange(RANGE * math.sqrt(len(self._scale)))
        planner.setProblemDefinition(self._definition)
        planner.setup()
        is_late = self._late(deadline)
        is_over = _bettered(planner, BETTERING[planner_id], is_late) if planner_id in BETTERING else is_late
        planner.solve(self._base.PlannerTerminationCondition(is_over))
        if not self._definition.hasExactSolution():
            raise PathNotFound(SearchFailure.TIMED_OUT)
        return np.array(
            [_configuration(state, self._scale) for state in self._definition.getSolutionPath().getStates()]
        )

    def roadmap(self, deadline: Deadline) -> Array:
        """Corners (m, n) [rad] or [m] of the path on a roadmap; raises `PathNotFound`. OMPL grows the roadmap only: its
        `solve` waits for a thread that waits for Python, for ever."""
        from ompl import geometric  # slow to load

        planner = geometric.PRM(self.information)
        planner.setProblemDefinition(self._definition)
        planner.setup()
        is_late = self._late(deadline)
        while not is_late():
            planner.growRoadmapPtc(self._base.PlannerTerminationCondition(_after(BATCH, is_late)))
            if is_late():
                break
            data = self._base.PlannerData(self.information)
            planner.getPlannerData(data)
            configurations = [
                _configuration(data.getVertex(row).getState(), self._scale) for row in range(data.numVertices())
            ]
            edges = [(row, int(other)) for row in range(len(configurations)) for other in data.getEdges(row)]
            found = shortest_path(
                self.start, self.goals, np.array(configurations), edges, self._scale, self._validity.is_line_free
            )
            if found is not None:
                return found
        raise PathNotFound(SearchFailure.TIMED_OUT)

    def _late(self, deadline: Deadline) -> Callable[[], bool]:
        """By the clock on the wall, where the deadline's own stands."""
        if deadline.clock is not endless:
            return deadline.has_passed
        is_over = self._base.timedPlannerTerminationCondition(deadline.left).eval
        return lambda: bool(is_over()) or deadline.has_passed()

    def _state(self, configuration: Array) -> Any:
        state = self.information.allocState()
        for index, value in enumerate((configuration / self._scale).tolist()):
            state[index] = value
        return state


def _bettered(planner: Any, questions: int, is_late: Callable[[], bool]) -> Callable[[], bool]:
    """True when the time is over, or so many questions after the first way; OMPL tells of it at the end only."""
    left = questions

    def is_over() -> bool:
        nonlocal left
        if math.isfinite(planner.bestCost().value()):
            left -= 1
        return left < 0 or bool(is_late())

    return is_over


def _configuration(state: Any, scale: Array) -> Array:
    """Joint values (n,) of a state."""
    values: Array = np.array([state[index] for index in range(len(scale))]) * scale
    return values


def _states(validity: ValidityChecker, scale: Array) -> Callable[[Any], bool]:
    """OMPL's question about states. It does not know the problem: a ring through OMPL and Python is never freed."""
    return lambda state: validity.is_free(_configuration(state, scale))


def _motions(information: Any, validity: ValidityChecker, scale: Array) -> Any:
    """OMPL's question about motions, answered between the samples too."""
    motions = _motions_class()(information)
    motions.is_line_free = lambda one, other: validity.is_line_free(
        _configuration(one, scale), _configuration(other, scale)
    )
    return motions


@cache
def _motions_class() -> type[Any]:
    from ompl import base  # slow to load

    class OmplMotionValidator(base.MotionValidator):  # type: ignore[misc]
        is_line_free: Callable[[Any, Any], bool]

        def checkMotion(self, first: Any, second: Any, *_last_valid: Any) -> bool:  # noqa: N802
            return self.is_line_free(first, second)

    return OmplMotionValidator


def _after(count: int, is_over: Callable[[], bool]) -> Callable[[], bool]:
    left = count

    def is_done() -> bool:
        nonlocal left
        left -= 1
        return left < 0 or is_over()

    return is_done
