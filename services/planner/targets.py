"""Where the tool is to be, and how far it is from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from services.arm.kinematics import Kinematics

Array = NDArray[np.float64]

POSITION_TOLERANCE = 1e-7  # [m] at which a solution is one
ROTATION_TOLERANCE = 1e-6  # [rad]
METRES_PER_RADIAN = 0.2  # how much a turn of the tool counts against its position while searching


@dataclass(frozen=True)
class Target:
    """A tool position (3,) [m] in the base frame and, where it matters, its rotation (3, 3)."""

    position: Array
    rotation: Array | None = None

    def error_and_jacobian(self, kinematics: Kinematics, positions: Array) -> tuple[Array, Array]:
        """What is missing, (3,) or (6,), and how the joints change that, (3, n) or (6, n)."""
        pose, jacobian = kinematics.tool_and_jacobian(positions)
        missing = self.position - pose.position
        if self.rotation is None:
            return missing, jacobian[:3]
        turn = METRES_PER_RADIAN * pin.log3(self.rotation @ pose.rotation.T)
        weighted = np.vstack((jacobian[:3], METRES_PER_RADIAN * jacobian[3:]))
        return np.concatenate((missing, turn)), weighted

    def is_met(self, error: Array) -> bool:
        """Whether what is missing is within the tolerances."""
        if float(error[:3] @ error[:3]) > POSITION_TOLERANCE**2:
            return False
        return len(error) == 3 or float(error[3:] @ error[3:]) <= (ROTATION_TOLERANCE * METRES_PER_RADIAN) ** 2
