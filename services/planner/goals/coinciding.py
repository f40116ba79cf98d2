"""What the closed form leaves open where the axes of two joints coincide: one turn, that either of them can make."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.arm.kinematics import Kinematics
from services.planner.goals.targets import POSITION_TOLERANCE, ROTATION_TOLERANCE, Target

Array = NDArray[np.float64]


def completed(target: Target, kinematics: Kinematics, guess: Array) -> list[Array]:
    """`guess` with the turn that is missing made by one joint or another; none where more than one turn is missing.

    A posture that is out of reach has its orientation right and its position wrong, and is left soonest.
    """
    far, away = target.misses(kinematics.tool(guess))
    if away < ROTATION_TOLERANCE:
        return [guess] if far < POSITION_TOLERANCE else []
    pose, jacobian = kinematics.tool_and_jacobian(guess)
    missing = target.turn(pose.rotation)
    found = []
    for joint, axis in enumerate(jacobian[3:].T):
        amount = float(axis @ missing)
        if float(np.linalg.norm(missing - amount * axis)) < ROTATION_TOLERANCE:
            turned = guess.copy()
            turned[joint] += amount
            far, away = target.misses(kinematics.tool(turned))
            if far < POSITION_TOLERANCE and away < ROTATION_TOLERANCE:
                found.append(turned)
    return found
