"""The error at the tool for steps that a joint is off, by the arm's Jacobian."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gemelo.libraries.arm.frames.transforms import Point
from gemelo.libraries.arm.model.description import Joint

CERTAIN = 1.0  # [steps] that a verified joint may be off: half for rounding, half for the switch's latch


def bounds(
    joints: Sequence[Joint], confidences: Sequence[float], travelled: Sequence[float], level: float
) -> tuple[float, ...]:
    """[steps] by which each joint may be off so that all hold with probability `level`; `confidences` are shares.

    The joints with the least confidence are given up until the product of the others reaches `level`. Those that are
    given up may be off by the steps that they have `travelled` since they were verified, or by their whole range if
    that is shorter: a motor that stands still under its pulses loses no more. The others are off by `CERTAIN`.
    """
    given_up: set[int] = set()
    order = sorted(range(len(joints)), key=lambda index: confidences[index])
    while math.prod(c for index, c in enumerate(confidences) if index not in given_up) < level:
        given_up.add(order[len(given_up)])
    return tuple(
        max(CERTAIN, min(travelled[index], _range(joint))) if index in given_up else CERTAIN
        for index, joint in enumerate(joints)
    )


def tool_shift(joints: Sequence[Joint], columns: Sequence[Point], steps: Sequence[float]) -> float:
    """[m] that the tool is off at most where each joint is off by so many steps, in either direction.

    `columns` of the Jacobian at the place where the arm is taken to be; a turn moves the tool along a chord.
    """
    return sum(_chord(joint, column, count) for joint, column, count in zip(joints, columns, steps, strict=True))


def known_shift(joints: Sequence[Joint], columns: Sequence[Point], steps: Sequence[float]) -> float:
    """[m] that the tool is off where each joint is off by just so many steps, with their signs; to first order."""
    total = [0.0, 0.0, 0.0]
    for joint, column, count in zip(joints, columns, steps, strict=True):
        for k in range(3):
            total[k] += column[k] * count / joint.steps.per_unit
    return math.hypot(*total)


def _range(joint: Joint) -> float:
    """[steps] from one end of the joint to the other; of a continuous one half a turn, beyond which it comes nearer."""
    span = joint.upper - joint.lower
    return (span if math.isfinite(span) else math.pi) * joint.steps.per_unit


def _chord(joint: Joint, column: Point, steps: float) -> float:
    size, moved = math.hypot(*column), abs(steps) / joint.steps.per_unit
    return size * moved if joint.unit == "m" else 2.0 * size * math.sin(min(moved, math.pi) / 2.0)
