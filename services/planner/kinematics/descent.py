"""One descent towards a tool target within the joint limits: damped least squares after Levenberg and Marquardt, with
the joints that press against a limit left out of the step.

The compiled descents take the same steps. Python does what they do not know: tolerances, a tool that only has to point
somewhere, and everything where they are not built.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics, Positions
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.kinematics.targets import POSITION_TOLERANCE, ROTATION_TOLERANCE, ToolTarget
from gemelo.services.planner.native import compiled
from gemelo.services.planner.native.compiled import where_built

Array = NDArray[np.float64]
Residual = Callable[[Array], tuple[Array, Array]]  # what is missing at a configuration, and how the joints change that
Test = Callable[[Array], bool]
ToolPosition = Callable[[Positions], tuple[float, float, float]]

# Tuning constants: chosen, where a line does not say measured or standard.
ITERATIONS = 40  # chosen: a start that has not come down by then mostly never does
STALL = 1e-5  # share of the squared error by which an iteration must improve
LARGEST_STEP = 0.8  # [rad] or [m] a joint may move in one iteration; chosen: beyond it the Jacobian misleads
NOTHING = np.zeros(0)


class Attempt(NamedTuple):
    """Where one descent ended: joint values (n,), and how far the tool is from its target."""

    positions: Array
    error: float  # [m], turns weighted in
    is_solution: bool


@where_built(lambda _: None)
def _native_descent(arm: ArmDescription) -> compiled.NativeDescent | None:
    return compiled.NativeDescent(arm)


def tool_position_in_python(_arm: ArmDescription, kinematics: Kinematics) -> ToolPosition:
    """By pinocchio: [m] in the base frame, from joint values (n,) [rad] or [m]."""

    def position_of(positions: Positions) -> tuple[float, float, float]:
        x, y, z = kinematics.tool(positions).position.tolist()
        return x, y, z

    return position_of


@where_built(tool_position_in_python)
def tool_position(arm: ArmDescription, kinematics: Kinematics) -> ToolPosition:
    """Where the tool is, of one arm: [m] in the base frame, from joint values (n,) [rad] or [m]."""
    return compiled.NativeDescent(arm).tool_position


class Descent:
    """Descends for one arm; in Python alone where `is_plain`, as where the core is not built."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, is_plain: bool = False) -> None:
        self._kinematics = kinematics
        self._lower = np.array([joint.lower for joint in arm.joints])
        self._upper = np.array([joint.upper for joint in arm.joints])
        self._identity = np.eye(len(arm.joints))
        self._native = None if is_plain else _native_descent(arm)

    def clip(self, positions: Array) -> Array:
        """The nearest joint values (n,) [rad] or [m] within the limits."""
        clipped: Array = np.minimum(np.maximum(positions, self._lower), self._upper)
        return clipped

    def descend(self, target: ToolTarget, start: Array) -> Attempt:
        """The nearest local optimum from `start` (n,) [rad] or [m]: exact where it can be, else at the edge of the
        tolerances."""
        attempt = self._exact(target, start)
        if attempt.is_solution or not target.is_tolerant:
            return attempt
        edge = self._descend(target, attempt.positions, lambda q: self._tolerant(target, q), target.is_at_edge)
        error, _ = target.error_and_jacobian(self._kinematics, edge.positions)
        return Attempt(edge.positions, math.sqrt(float(error @ error)), target.is_met(error))

    def _exact(self, target: ToolTarget, start: Array) -> Attempt:
        if self._native is None or target.pointing is not None:
            return self._descend(
                target, start, lambda q: target.error_and_jacobian(self._kinematics, q), target.is_exact
            )
        return Attempt(*self._native.descend(start[None], *_exact_target(target))[0])

    def descend_all(self, target: ToolTarget, starts: Array) -> list[Attempt]:
        """As `descend`, from each of `starts` (m, n) [rad] or [m]; in one call where it is an exact pose."""
        if self._native is None or target.pointing is not None or target.is_tolerant:
            return [self.descend(target, start) for start in starts]
        return [Attempt(*end) for end in self._native.descend(starts, *_exact_target(target))]

    def knows_centring(self, target: ToolTarget) -> bool:
        """True if `centred` answers for this target: built, and the target is an exact one."""
        return self._native is not None and target.pointing is None and not target.is_tolerant

    def centred(self, target: ToolTarget, solution: Array, middle: Array, weight: Array) -> Array | None:
        """As `Centring.centred`, compiled; joint values (n,) [rad] or [m], `weight` (n,) by the distance from
        `middle` (n,)."""
        assert self._native is not None
        return self._native.centred(solution, middle, weight, *_exact_target(target))

    def _tolerant(self, target: ToolTarget, positions: Array) -> tuple[Array, Array]:
        return target.beyond_tolerances(*target.error_and_jacobian(self._kinematics, positions))

    def _descend(self, target: ToolTarget, start: Array, residual: Residual, is_there: Test) -> Attempt:
        positions = self.clip(start)
        error, jacobian = residual(positions)
        cost, damping = float(error @ error), 1e-6
        for _ in range(ITERATIONS):
            if is_there(error):
                break
            pull = error @ jacobian
            free = self._is_free(positions, pull)
            if not free.any() or float(np.abs(pull[free]).max()) < 1e-10:
                break
            trial = self._step(positions, jacobian, pull, free, damping)
            trial_error, trial_jacobian = residual(trial)
            trial_cost = float(trial_error @ trial_error)
            if trial_cost < cost:
                has_stalled = trial_cost > cost * (1.0 - STALL)
                positions, error, jacobian, cost = trial, trial_error, trial_jacobian, trial_cost
                damping = max(damping * 0.1, 1e-12)
                if has_stalled:
                    break
            else:
                damping *= 10.0
                if damping > 1e4:
                    break
        return Attempt(positions, math.sqrt(cost), is_there(error))

    def _is_free(self, positions: Array, pull: Array) -> NDArray[np.bool_]:
        """The joints that no limit holds back."""
        above, below = positions > self._lower, positions < self._upper
        free: NDArray[np.bool_] = (above | (pull > 0.0)) & (below | (pull < 0.0))
        return free

    def _step(self, positions: Array, jacobian: Array, pull: Array, free: NDArray[np.bool_], damping: float) -> Array:
        active = jacobian if free.all() else jacobian * free
        step = np.linalg.solve(active.T @ active + damping * self._identity, pull * free)
        longest = float(np.abs(step).max())
        if longest > LARGEST_STEP:
            step *= LARGEST_STEP / longest
        return self.clip(positions + step)


def _exact_target(target: ToolTarget) -> tuple[Array, Array, float, float, float]:
    """As the compiled descents take it."""
    rotation = NOTHING if target.rotation is None else target.rotation.reshape(9)
    return target.position, rotation, target.metres_per_radian, POSITION_TOLERANCE, ROTATION_TOLERANCE
