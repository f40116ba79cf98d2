"""A question for a path in OMPL 2.0's terms: one thread, seeded; distances are counted in time at full speed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.path import Sought
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline, endless

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SEEDS = 2**32 - 2  # standard: OMPL takes 32 bits, and 0 means any
AROUND = math.pi  # [rad] about start and goals that a joint without limits is searched in


def load_ompl() -> None:
    """Now, what the first search would wait for."""
    from ompl import base, geometric, util  # noqa: F401

    _motions_class()


class OmplProblem:
    """States are joint values divided by the speed limits, `scale` (n,)."""

    def __init__(self, sought: Sought) -> None:
        from ompl import base  # slow to load

        arm, validity, ends = sought.arm, sought.validity, np.vstack((sought.start, sought.goals))
        self.scale = np.array([joint.velocity for joint in arm.joints])
        self.base: Any = base
        space = base.RealVectorStateSpace(len(arm.joints))
        bounds = base.RealVectorBounds(len(arm.joints))
        for index, (joint, column) in enumerate(zip(arm.joints, ends.T, strict=True)):
            low, high = float(column.min()) - AROUND, float(column.max()) + AROUND
            bounds.setLow(index, (joint.lower if math.isfinite(joint.lower) else low) / joint.velocity)
            bounds.setHigh(index, (joint.upper if math.isfinite(joint.upper) else high) / joint.velocity)
        space.setBounds(bounds)
        self.information: Any = base.SpaceInformation(space)
        self.information.setStateValidityChecker(_states(validity, self.scale))
        self.information.setMotionValidator(_motions(self.information, validity, self.scale))
        self.information.setup()
        self._set_ends(sought.start, sought.goals, sought.seed)

    def _set_ends(self, start: Array, goals: Array, seed: int) -> None:
        """From here on OMPL's random numbers begin anew."""
        from ompl import util  # slow to load

        util.noOutputHandler()
        util.RNG.setSeed(seed % SEEDS + 1)
        self.definition: Any = self.base.ProblemDefinition(self.information)
        self.definition.addStartState(self._state(start))
        ends = self.base.GoalStates(self.information)
        for goal in goals:
            ends.addState(self._state(goal))
        self.definition.setGoal(ends)
        self.definition.setOptimizationObjective(self.base.PathLengthOptimizationObjective(self.information))

    def late(self, deadline: Deadline) -> Callable[[], bool]:
        """By the clock on the wall, where the deadline's own stands."""
        if deadline.clock is not endless:
            return deadline.has_passed
        is_over = self.base.timedPlannerTerminationCondition(deadline.left).eval
        return lambda: bool(is_over()) or deadline.has_passed()

    def _state(self, configuration: Array) -> Any:
        state = self.information.allocState()
        for index, value in enumerate((configuration / self.scale).tolist()):
            state[index] = value
        return state


def configuration_of(state: Any, scale: Array) -> Array:
    """Joint values (n,) [rad] or [m] of a state, whose values are divided by `scale` (n,)."""
    values: Array = np.array([state[index] for index in range(len(scale))]) * scale
    return values


def _states(validity: ValidityChecker, scale: Array) -> Callable[[Any], bool]:
    """OMPL's question about states. It does not know the problem: a ring through OMPL and Python is never freed."""
    return lambda state: validity.is_free(configuration_of(state, scale))


def _motions(information: Any, validity: ValidityChecker, scale: Array) -> Any:
    """OMPL's question about motions, answered between the samples too."""
    motions = _motions_class()(information)
    motions.is_line_free = lambda one, other: validity.is_line_free(
        configuration_of(one, scale), configuration_of(other, scale)
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
