"""The second half of validation: may this arm do it? Points and everything between them against every limit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.reasons import Reason, Remedy, because, remedy
from gemelo.services.stepper_gateway.goals.pieces import PIECE, Pieces
from gemelo.services.stepper_gateway.goals.rejections import invalid
from gemelo.services.stepper_gateway.motion.knot_sources import KNOT_TIME
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.paths import TimedPath
from gemelo.services.stepper_gateway.parameters import GatewayParameters

SLACK = 1e-9  # [rad] or [m]: rounding of a limit that was computed


def points_within(trajectory: JointTrajectory, joints: tuple[Joint, ...]) -> Pieces[None]:
    """Every point within the joint limits; raises `GoalRejected`."""
    for index, point in enumerate(trajectory.points):
        for joint, position in zip(joints, point.positions, strict=True):
            if not joint.lower - SLACK <= position <= joint.upper + SLACK:
                raise invalid(at_point(beyond(joint, position), index, point.time_from_start))
        if index % PIECE == PIECE - 1:
            yield


@dataclass(frozen=True)
class Samples:
    """Times at twice the knots' rate, both ends of a path of `duration` [s] among them: those in [begin, end)."""

    duration: float
    begin: float = 0.0
    end: float = math.inf

    def __iter__(self) -> Iterator[float]:
        count = max(1, int(self.duration / (KNOT_TIME / 2)) + 1)
        step = self.duration / count
        first = max(0, int(self.begin / step) - 1) if step else 0
        for index in range(first, count + 1):
            t = self.duration * index / count
            if t >= self.end:
                return
            if t >= self.begin:
                yield t


def path_within(
    path: TimedPath, samples: Samples, joints: tuple[Joint, ...], parameters: GatewayParameters, tick_hz: int
) -> Pieces[None]:
    """The path between the points too, at the times `samples`; raises `GoalRejected`."""
    bounds = [_Bound(joint, parameters, tick_hz) for joint in joints]
    for number, t in enumerate(samples, 1):
        knot = path.at(t)
        for column, bound in enumerate(bounds):
            if not bound.holds(knot.position[column], knot.velocity[column], knot.acceleration[column]):
                raise invalid(bound.complaint(knot, column, t))
        if number % PIECE == 0:
            yield


def within(knot: Knot, joints: tuple[Joint, ...]) -> bool:
    """True if every joint is within its limits."""
    return all(j.lower - SLACK <= p <= j.upper + SLACK for j, p in zip(joints, knot.position, strict=True))


def beyond(joint: Joint, position: float) -> Reason:
    """A `position` [rad] or [m] outside the limits."""
    side, limit = ("lower", joint.lower) if position < joint.lower else ("upper", joint.upper)
    within = remedy("stay_within", lower=joint.lower, upper=joint.upper, unit=joint.unit)
    named = {"joint": joint.name, "side": side, "unit": joint.unit}
    return because("goal.limit.position", within, value=position, limit=limit, **named)


class _Bound:
    """All limits of one joint."""

    def __init__(self, joint: Joint, parameters: GatewayParameters, tick_hz: int) -> None:
        self.joint = joint
        self.lower, self.upper = joint.lower - SLACK, joint.upper + SLACK
        self.velocity = joint.velocity * (1.0 + parameters.velocity_margin)
        self.acceleration = joint.acceleration * (1.0 + parameters.acceleration_margin)
        self.step_rate = step_rate_limit(joint, tick_hz)
        self._rate_velocity = self.step_rate / joint.steps.per_unit

    def holds(self, position: float, velocity: float, acceleration: float) -> bool:
        """True if the joint is within its limits; [rad] or [m], and per s and s^2."""
        return (
            self.lower <= position <= self.upper
            and abs(velocity) <= min(self.velocity, self._rate_velocity)
            and abs(acceleration) <= self.acceleration
        )

    def complaint(self, knot: Knot, column: int, t: float) -> Reason:
        """The limit that `knot` breaks at `t` [s] in its joint number `column`."""
        joint = self.joint
        position, velocity, acceleration = (values[column] for values in knot)
        if not self.lower <= position <= self.upper:
            return because("goal.limit.position.between", beyond(joint, position), time=t)
        if abs(velocity) > self._rate_velocity:
            rate = abs(velocity) * joint.steps.per_unit
            slower = _slower(rate, self.step_rate)
            return because("goal.limit.step_rate", slower, joint=joint.name, rate=rate, limit=self.step_rate, time=t)
        named = {"joint": joint.name, "unit": joint.unit}
        if abs(velocity) > self.velocity:
            slower = _slower(velocity, joint.velocity)
            values = {"value": abs(velocity), "limit": joint.velocity, "time": t}
            return because("goal.limit.velocity", slower, **named, **values)
        longer = remedy("slower_or_timed", factor=(abs(acceleration) / joint.acceleration) ** 0.5)
        values = {"value": abs(acceleration), "limit": joint.acceleration, "time": t}
        return because("goal.limit.acceleration", longer, **named, **values)


def step_rate_limit(joint: Joint, tick_hz: int) -> float:
    """[steps/s] that the driver's pulses and the device's tick allow: a pulse is one tick high and one low."""
    return min(tick_hz / 2.0, 1e6 / (joint.driver.step_high_us + joint.driver.step_low_us))


def at_point(reason: Reason, index: int, time: float) -> Reason:
    """What is wrong with one point of a trajectory, at `time` [s] of it."""
    return because("goal.limit.position.at_point", reason, point=index, time=time)


def _slower(value: float, limit: float) -> Remedy:
    return remedy("slower", factor=abs(value) / limit)
