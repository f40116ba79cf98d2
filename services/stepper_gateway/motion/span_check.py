"""The check that the cubics between knots stay within the joints' travel, which the device makes as well."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gemelo.libraries.arm.model.description import Joint
from gemelo.services.stepper_gateway.motion.knots import Knot

ROUNDING = 1.0 / 256.0  # [steps] of the wire; standard: firmware/PROTOCOL.md


def leaving(joints: tuple[Joint, ...], knots: Sequence[Knot], spans: Sequence[float]) -> int | None:
    """Column of a joint that leaves its travel between two of `knots`, which are `spans` [s] apart; None if none."""
    for column, joint in enumerate(joints):
        slack = ROUNDING / joint.steps.per_unit
        lower, upper = joint.lower + slack, joint.upper - slack
        for first, second, span in zip(knots, knots[1:], spans, strict=False):
            a, b = first.position[column], second.position[column]
            reach = span * max(abs(first.velocity[column]), abs(second.velocity[column]))
            if lower <= min(a, b) - reach and max(a, b) + reach <= upper:
                continue
            low, high = extremes(a, first.velocity[column] * span, b, second.velocity[column] * span)
            if low < joint.lower - slack or high > joint.upper + slack:
                return column
    return None


def extremes(p0: float, m0: float, p1: float, m1: float) -> tuple[float, float]:
    """Least and largest value of the cubic from `p0` to `p1` with the slopes `m0` and `m1` over a unit of time."""
    values = [p0, p1]
    c3, c2 = 2.0 * (p0 - p1) + m0 + m1, 3.0 * (p1 - p0) - 2.0 * m0 - m1
    values += [p0 + u * (m0 + u * (c2 + u * c3)) for u in _roots(3.0 * c3, 2.0 * c2, m0) if 0.0 < u < 1.0]
    return min(values), max(values)


def _roots(a: float, b: float, c: float) -> list[float]:
    """Of a u^2 + b u + c, real ones; without the cancellation that a small `a` brings."""
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    q = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return [each for each in (q / a if a else math.inf, c / q if q else math.inf) if math.isfinite(each)]
