"""Velocity, acceleration and jerk limits of all joints together."""

from __future__ import annotations

from typing import NamedTuple

from schemas.message import Vector
from services.arm.model.description import Joint
from services.stepper_gateway.motion.knots import Knot


class Limits(NamedTuple):
    """One value per joint, all positive."""

    velocity: Vector  # [rad/s] or [m/s]
    acceleration: Vector  # [rad/s^2] or [m/s^2]
    jerk: Vector  # [rad/s^3] or [m/s^3]

    @classmethod
    def of(cls, joints: tuple[Joint, ...]) -> Limits:
        return cls(
            tuple(joint.velocity for joint in joints),
            tuple(joint.acceleration for joint in joints),
            tuple(joint.jerk for joint in joints),
        )

    def raised_to(self, *knots: Knot) -> Limits:
        """Limits that these knots keep: ruckig takes a start beyond its limits without a word.

        A validated trajectory may exceed a limit by the gateway's small margins, and so may its knots.
        """
        velocity, acceleration = list(self.velocity), list(self.acceleration)
        for knot in knots:
            velocity = [max(a, abs(b)) for a, b in zip(velocity, knot.velocity, strict=True)]
            acceleration = [max(a, abs(b)) for a, b in zip(acceleration, knot.acceleration, strict=True)]
        return Limits(tuple(velocity), tuple(acceleration), self.jerk)
