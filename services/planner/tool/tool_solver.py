"""The posture near another that has the tool where it is to be, by Newton's steps; and how far the tool is off."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from services.arm.kinematics import Kinematics, Pose
from services.planner.tool.tool_path import METRES_PER_RADIAN

Array = NDArray[np.float64]

LARGEST_STEP = 0.3  # [rad] or [m] of a joint in one iteration
EXACT = 1e-11  # [m] at which the tool is where it should be; as much for its turn
ITERATIONS = 16
DAMPING = 1e-12
NULL_DAMPING = 1e-6


class ToolSolver:
    """For one arm; of one that cannot turn its tool freely only the position is held."""

    def __init__(self, kinematics: Kinematics, holds_turn: bool) -> None:
        self._kinematics, self._holds_turn = kinematics, holds_turn

    def solve(self, pose: Pose, guess: Array) -> Array | None:
        """The posture near `guess` that has the tool there, limits apart; None where there is none."""
        posture = guess
        for _ in range(ITERATIONS):
            step, missing = self._newton(pose, posture)
            if missing < EXACT:
                return posture
            posture = posture + step * min(1.0, LARGEST_STEP / max(float(np.abs(step).max()), LARGEST_STEP))
        return None

    def manipulability(self, posture: Array) -> float:
        """The smallest singular value of what is held of the tool, turns counted as the path counts them."""
        jacobian = self._kinematics.jacobian(posture)
        held = np.vstack((jacobian[:3], METRES_PER_RADIAN * jacobian[3:])) if self._holds_turn else jacobian[:3]
        return float(np.linalg.svd(held, compute_uv=False)[-1])

    def error(self, pose: Pose, posture: Array) -> float:
        """[m] that the tool is off; turns counted as the path counts them, where they are held."""
        now = self._kinematics.tool(posture)
        missing = float(np.linalg.norm(pose.position - now.position))
        if not self._holds_turn:
            return missing
        return max(missing, METRES_PER_RADIAN * float(np.linalg.norm(pin.log3(pose.rotation @ now.rotation.T))))

    def _newton(self, pose: Pose, posture: Array) -> tuple[Array, float]:
        """The step of the joints, and what is missing [m]; the turn that is not held is followed as far as it may."""
        now, jacobian = self._kinematics.tool_and_jacobian(posture)
        missing = pose.position - now.position
        turn = pin.log3(pose.rotation @ now.rotation.T)
        if self._holds_turn:
            missing = np.concatenate((missing, METRES_PER_RADIAN * turn))
            held = np.vstack((jacobian[:3], METRES_PER_RADIAN * jacobian[3:]))
            return _damped(held, missing, DAMPING), float(np.linalg.norm(missing))
        step = _damped(jacobian[:3], missing, DAMPING)
        if len(posture) > 3:
            free = np.eye(len(posture)) - np.linalg.pinv(jacobian[:3]) @ jacobian[:3]
            left = jacobian[3:] @ free
            step = step + free @ _damped(left, turn - jacobian[3:] @ step, NULL_DAMPING)
        return step, float(np.linalg.norm(missing))


def _damped(jacobian: Array, missing: Array, damping: float) -> Array:
    """The least-squares step, the shortest where there are many (Nakamura and Hanafusa 1986)."""
    square = jacobian @ jacobian.T
    square[np.diag_indices_from(square)] += damping
    step: Array = jacobian.T @ np.linalg.solve(square, missing)
    return step
