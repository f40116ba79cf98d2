"""A knot: where every joint is to be, how fast, and bending how, at one instant; and the limits of all joints."""

from __future__ import annotations

import math
from typing import NamedTuple

from gemelo.libraries.arm.device.device_config import UNLIMITED_Q8
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector


class Knot(NamedTuple):
    """In joint units, in the arm's joint order."""

    position: Vector  # [rad] or [m]
    velocity: Vector  # [rad/s] or [m/s]
    acceleration: Vector  # [rad/s^2] or [m/s^2]

    @classmethod
    def at_rest(cls, position: Vector) -> Knot:
        """A knot that stands at `position` [rad] or [m]."""
        zeros = (0.0,) * len(position)
        return cls(tuple(position), zeros, zeros)

    @property
    def is_at_rest(self) -> bool:
        return not any(self.velocity)


class StepKnot(NamedTuple):
    """The same on the wire: 1/256 steps and 1/256 steps/s."""

    position: tuple[int, ...]
    velocity: tuple[int, ...]


class StepEncoder:
    """Knots as the wire says them, for one arm; absolute, so nothing accumulates.

    A position that was computed may lie a rounding beyond the limit that the device was told: it is put on it.
    """

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        self._scales = tuple(joint.steps for joint in joints)
        self._rates = tuple(joint.steps.per_unit * 256.0 for joint in joints)
        self._lower = tuple(_bound(joint, joint.lower) for joint in joints)
        self._upper = tuple(_bound(joint, joint.upper) for joint in joints)

    def encode(self, knot: Knot) -> StepKnot:
        """The nearest knot within the device's limits."""
        positions = zip(self._scales, knot.position, self._lower, self._upper, strict=True)
        return StepKnot(
            tuple([min(max(scale.to_q8(p), low), high) for scale, p, low, high in positions]),
            tuple([round(v * rate) for rate, v in zip(self._rates, knot.velocity, strict=True)]),
        )


def _bound(joint: Joint, limit: float) -> int:
    """A position limit on the wire; a continuous joint has the device's widest."""
    if math.isinf(limit):
        return -UNLIMITED_Q8 if limit < 0.0 else UNLIMITED_Q8
    return joint.steps.to_q8(limit)


def whole_steps(q8: int) -> int:
    """The step count that the device emits for a path position: floor(p + 0.5)."""
    return (q8 + 128) >> 8


def braking_time(knot: Knot, joints: tuple[Joint, ...]) -> float:
    """[s] from a knot to rest, at the acceleration limits."""
    return max(abs(rate) / joint.acceleration for joint, rate in zip(joints, knot.velocity, strict=True))


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
