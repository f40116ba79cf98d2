"""Targets at times ahead, as the chunk of actions of a policy: they are played by a curve through them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.joints import LEAST_APART, LONGEST_AHEAD, MOST_AHEAD, JointTargets, TargetAhead
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.goals.limit_checks import SLACK, beyond
from gemelo.services.stepper_gateway.goals.rejections import invalid


class Ahead(NamedTuple):
    """One target of all joints."""

    time: float  # [s] after the first one of its message
    position: Vector  # [rad] or [m]
    velocity: Vector  # [rad/s] or [m/s]; empty: that of the curve


def require_ahead(targets: JointTargets, joints: tuple[Joint, ...]) -> None:
    """Raises `GoalRejected` for targets ahead that cannot be played; their names are known to be joints."""
    if len(targets.ahead) > MOST_AHEAD:
        raise invalid(because("target.ahead.many", count=len(targets.ahead), limit=MOST_AHEAD))
    named = [next(joint for joint in joints if joint.name == name) for name in targets.name]
    before = 0.0
    for point, each in enumerate(targets.ahead, start=1):
        if (wrong := _wrong(each, before, named)) is not None:
            raise invalid(because("target.ahead.at", wrong, point=point, time=each.time))
        before = each.time


def _wrong(each: TargetAhead, before: float, named: Sequence[Joint]) -> Reason | None:
    """`before` [s] is the time of the target before."""
    if each.time - before < LEAST_APART - 1e-9:
        return because("target.ahead.apart", apart=each.time - before, limit=LEAST_APART)
    if each.time > LONGEST_AHEAD:
        return because("target.ahead.late", time=each.time, limit=LONGEST_AHEAD)
    if len(each.position) != len(named):
        return because("target.positions.count", named=len(named), given=len(each.position))
    if len(each.velocity) not in (0, len(named)):
        return because("target.velocities.count", named=len(named), given=len(each.velocity))
    for joint, position in zip(named, each.position, strict=True):
        if not joint.lower - SLACK <= position <= joint.upper + SLACK:
            return beyond(joint, position)
    return None


def ahead_of(targets: JointTargets, columns: Sequence[int], base: Vector) -> tuple[Ahead, ...]:
    """Those of the joints in `columns`; the others stand at `base` [rad] or [m]."""
    return tuple(
        Ahead(each.time, filled(dict(zip(columns, each.position, strict=True)), base),
              filled(dict(zip(columns, each.velocity, strict=True)), (0.0,) * len(base)) if each.velocity else ())
        for each in targets.ahead
    )  # fmt: skip


def filled(values: Mapping[int, float], base: Vector) -> Vector:
    """`base` [rad] or [m], or per second, with the values by column."""
    return tuple(values.get(column, value) for column, value in enumerate(base))


def curve_rates(times: Sequence[float], values: Sequence[float]) -> list[float]:
    """Slopes of the cubics through `values` at `times` [s] that go beyond no value (Fritsch and Butland 1984).

    The first is that of the line to the second, the last 0: what comes after it is not known.
    """
    gaps = [later - sooner for sooner, later in pairwise(times)]
    slopes = [(b - a) / gap for (a, b), gap in zip(pairwise(values), gaps, strict=True)]
    rates = [slopes[0]]
    for (before, after), (left, right) in zip(pairwise(gaps), pairwise(slopes), strict=True):
        same = left * right > 0.0
        parts = (2.0 * after + before) / left + (after + 2.0 * before) / right if same else 1.0
        rates.append(3.0 * (before + after) / parts if same else 0.0)
    return [*rates, 0.0]


def on_cubic(first: float, second: float, rates: tuple[float, float], span: float, share: float) -> tuple[float, float]:
    """Value and slope at `share` of the cubic of `span` [s] from `first` to `second`, with the slopes at its ends."""
    rise, left, right = second - first, span * rates[0], span * rates[1]
    bend, twist = 3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise
    value = first + share * (left + share * (bend + share * twist))
    return value, (left + share * (2.0 * bend + share * 3.0 * twist)) / span
