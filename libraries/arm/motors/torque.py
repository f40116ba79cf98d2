"""The share of a motor's pull-out torque that a motion asks for."""

from __future__ import annotations

import math
from itertools import pairwise

from gemelo.schemas.robot import Motor, PullOut

NO_CURVE = 0.08  # chosen: of the torque, at the joint's limits, for a motor without a pull-out curve: as rm1's need
BEYOND = 1e3  # the share where the curve gives no torque any more


def torque_at(curve: PullOut, rate: float) -> float:
    """[N m] at `rate` [steps/s], straight between the points and 0 beyond the last."""
    points = list(zip(curve.speed, curve.torque, strict=True))
    if rate <= points[0][0]:
        return points[0][1]
    for (low, first), (high, second) in pairwise(points):
        if rate <= high:
            return first + (second - first) * (rate - low) / (high - low)
    return 0.0


def torque_share(motor: Motor, rate: float, acceleration: float) -> float:
    """Of the torque at `rate` [steps/s], what inertia and friction need at `acceleration` [steps/s^2]; no signs.

    T = J dw/dt + friction at the motor's shaft, w = 2 pi steps / pulses_per_turn (any text on stepper selection).
    Braking counts as accelerating. Raises ValueError for a motor without a curve.
    """
    curve = motor.pull_out
    if curve is None:
        raise ValueError("the motor has no pull_out")
    needed = curve.inertia * acceleration * math.tau / motor.pulses_per_turn + curve.friction
    available = torque_at(curve, rate)
    return min(needed / available, BEYOND) if available > 0.0 else BEYOND
