"""The configuration near another that has the tool where it is to be, by Newton's steps; and how far the tool is
off."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics
from gemelo.services.planner.cartesian.tool_path import METRES_PER_RADIAN

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
LARGEST_STEP = 0.3  # [rad] or [m] of a joint in one iteration; chosen: the Jacobian is a good guide so far
EXACT = 1e-11  # [m] at which the tool is where it should be; as much for its turn
LAST_STEP = 1e-5  # [rad] or [m]: what is left after a step so small is its square
ITERATIONS = 10  # chosen: Newton doubles its digits each time, and starts near; more do not help
DAMPING = 1e-12  # chosen: above rounding of J J^T, below anything that shows in the result
NULL_DAMPING = 1e-6  # chosen: larger, as a turn that is only preferred must not drive joints far
WEIGHTS = np.array([[1.0]] * 3 + [[METRES_PER_RADIAN]] * 3)


class ToolSolver:
    """For one arm; of one that cannot turn its tool freely only the position is held."""

    def __init__(self, kinematics: Kinematics, holds_turn: bool) -> None:
        self._kinematics, self._holds_turn = kinematics, holds_turn

    def solve(self, pose: FramePose, guess: Array) -> Array | None:
        """Joint values (n,) [rad] or [m] near `guess` (n,) with the tool at `pose` in the base frame, joint limits
        ignored; None where Newton's method finds none."""
        configuration = guess
        for _ in range(ITERATIONS):
            step, missing, left = self._newton(pose, configuration)
            if missing < EXACT:
                return configuration
            largest = float(np.abs(step).max())
            if largest < LAST_STEP and left < EXACT:
                return configuration + step
            configuration = configuration + step * min(1.0, LARGEST_STEP / max(largest, LARGEST_STEP))
        return None

    def manipulability(self, configuration: Array) -> float:
        """The smallest singular value of the held rows of the Jacobian at `configuration` (n,) [rad] or [m], turns
        weighted by `METRES_PER_RADIAN`."""
        jacobian = self._kinematics.jacobian(configuration)
        held = WEIGHTS * jacobian if self._holds_turn else jacobian[:3]
        return float(np.linalg.svd(held, compute_uv=False)[-1])

    def error(self, pose: FramePose, configuration: Array) -> float:
        """[m] that the tool at `configuration` (n,) [rad] or [m] is off `pose`; where turns are held, each counts as on
        the path."""
        now = self._kinematics.tool(configuration)
        missing = _length(pose.position - now.position)
        if not self._holds_turn:
            return missing
        return max(missing, METRES_PER_RADIAN * _length(pin.log3(pose.rotation @ now.rotation.T)))

    def _newton(self, pose: FramePose, configuration: Array) -> tuple[Array, float, float]:
        """The step of the joints, what is missing [m], and what of that a straight arm would still miss after it.

        The turn that is not held is followed as far as it may.
        """
        now, jacobian = self._kinematics.tool_and_jacobian(configuration)
        missing = pose.position - now.position
        turn = pin.log3(pose.rotation @ now.rotation.T)
        if self._holds_turn:
            missing = np.concatenate((missing, METRES_PER_RADIAN * turn))
            held = WEIGHTS * jacobian
            step = _damped(held, missing, DAMPING)
            return step, _length(missing), _length(missing - held @ step)
        held = jacobian[:3]
        step = _damped(held, missing, DAMPING)
        if len(configuration) > 3:
            free = np.eye(len(configuration)) - np.linalg.pinv(held) @ held
            left = jacobian[3:] @ free
            step = step + free @ _damped(left, turn - jacobian[3:] @ step, NULL_DAMPING)
        return step, _length(missing), _length(missing - held @ step)


def _damped(jacobian: Array, missing: Array, damping: float) -> Array:
    """The least-squares step, the shortest where there are many (Nakamura and Hanafusa 1986)."""
    square = jacobian @ jacobian.T
    square.flat[:: len(square) + 1] += damping
    step: Array = jacobian.T @ np.linalg.solve(square, missing)
    return step


def _length(vector: Array) -> float:
    return math.sqrt(float(vector @ vector))
