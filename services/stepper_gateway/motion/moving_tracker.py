"""The tracker of a moving reference, from a knot of the path on, and to rest: ruckig in the reference's frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from ruckig import (
    ControlInterface,
    InputParameter,
    OutputParameter,
    Result,
    Ruckig,
    Synchronization,
    Trajectory,
)

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits

NEAR_DT = 10_000  # [us] between the knots that follow; measured: 20 ms ones come 6 ms later
EFFORT = 0.97  # of the accelerations, to follow; chosen: a cubic between two knots bends more than the profile
CALM = 0.9  # of the accelerations, to stop; chosen: the knots are farther apart, and a hold may come on top of it
CALMER = 0.85  # the same with knots beyond TAIL_DT; chosen as above
TAIL_DT, LARGEST_TAIL_DT = 30_000, 50_000  # [us] between the knots of a stop; chosen: farther ones bend too much
FINEST_TAIL_DT = 20_000  # [us] chosen: as the knots of every other motion
SPEED = 0.999  # of the velocities; rounding to the wire's resolution must not exceed them
FASTEST = 0.95  # of a velocity limit, that a reference may have; chosen: the rest is for catching up
CATCHES_UP = 0.25  # [s] in which an arm makes up for the error that is not far; chosen: a person's reaction
ROOM = 0.5  # of an acceleration, with which a reference brakes before a travel's end; chosen: far from overshooting

ReferenceAt = Callable[[float], tuple[Vector, Vector]]  # place and velocity at a moment [s] monotonic


class Tail(NamedTuple):
    """The knots of a stop, the last one at rest."""

    knots: list[Knot]
    dt_us: int  # between them


class MovingTracker:
    """One online generator for all joints, each as fast as it can on its own."""

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        self._joints = joints
        limits = Limits.of(joints)
        speeds = tuple(SPEED * v for v in limits.velocity)
        self._limits = Limits(speeds, tuple(EFFORT * a for a in limits.acceleration), limits.jerk)
        self._acceleration = limits.acceleration
        count = len(joints)
        self._generator = Ruckig(count, NEAR_DT * 1e-6)
        self._problem, self._output = InputParameter(count), OutputParameter(count)
        self._problem.synchronization = Synchronization.No
        zeros = (0.0,) * count
        self._problem.target_position = self._problem.target_velocity = self._problem.target_acceleration = zeros
        self._planner, self._stop = Ruckig(count), Trajectory(count)
        self._settling = InputParameter(count)
        self._settling.synchronization = Synchronization.No
        self._settling.target_velocity = self._settling.target_acceleration = zeros
        self._braking = InputParameter(count)
        self._braking.synchronization = Synchronization.No
        self._braking.control_interface = ControlInterface.Velocity
        self._braking.target_velocity = self._braking.target_acceleration = zeros

    def near(self, knot: Knot, begins: float, count: int, reference: ReferenceAt, catch_up: bool) -> list[Knot]:
        """`count` knots after `knot`, which is played at `begins` [s] monotonic; `catch_up` with the reference also
        from far behind, else only towards its place."""
        dt = NEAR_DT * 1e-6
        knots: list[Knot] = []
        for index in range(1, count + 1):
            place, rate = self._within(*reference(begins + index * dt))
            knot = self._next(knot, place, self._rate_for(knot, place, rate, catch_up), dt)
            knots.append(knot)
        return knots

    def tail(self, knot: Knot, most: int) -> Tail:
        """To rest from `knot`, in at most `most` knots where knots of `LARGEST_TAIL_DT` allow that."""
        if knot.is_at_rest and not any(knot.acceleration):
            return Tail([Knot.at_rest(knot.position)], FINEST_TAIL_DT)
        duration = self._brake(knot, CALM)
        dt_us = max(FINEST_TAIL_DT, 10_000 * math.ceil(duration / most * 100.0))
        if dt_us > TAIL_DT:
            duration = self._brake(knot, CALMER)
            dt_us = min(LARGEST_TAIL_DT, 10_000 * math.ceil(duration / most * 100.0))
        return self._sampled(duration, dt_us)

    def _sampled(self, duration: float, dt_us: int) -> Tail:
        """The profile in `_stop`, which lasts `duration` [s]."""
        count = max(1, math.ceil(duration * 1e6 / dt_us - 1e-6))
        knots = [Knot(*map(tuple, self._stop.at_time(index * dt_us * 1e-6))) for index in range(1, count)]
        return Tail([*knots, Knot.at_rest(tuple(self._stop.at_time(duration)[0]))], dt_us)

    def settle(self, knot: Knot, target: Vector, most: int) -> Tail:
        """To rest at `target` [rad] or [m], as `tail`."""
        problem, calm = self._settling, tuple(CALMER * a for a in self._acceleration)
        problem.current_position, problem.current_velocity, problem.current_acceleration = knot
        problem.target_position = target
        limits = Limits(self._limits.velocity, calm, self._limits.jerk).raised_to(knot)
        problem.max_velocity, problem.max_acceleration, problem.max_jerk = limits
        result = self._planner.calculate(problem, self._stop)
        if result not in (Result.Working, Result.Finished):
            raise RuntimeError(f"ruckig finds no way from {knot} to rest at {target}: {result}")
        duration = self._stop.duration
        dt_us = max(FINEST_TAIL_DT, min(LARGEST_TAIL_DT, 10_000 * math.ceil(duration / most * 100.0)))
        return self._sampled(duration, dt_us)

    def far(self, rate: Vector, catch_up: bool) -> Vector:
        """[rad] or [m] per joint beyond which an arm that is to go at `rate` [rad/s] or [m/s] is far behind.

        With `catch_up` that grows with the speed, so that who was left behind can catch up.
        """
        found = []
        for v, top in zip(rate, self._limits.acceleration, strict=True):
            stopping = 0.5 * abs(v) * (abs(v) / top + 0.1) if catch_up else 0.0
            found.append(0.5 * top * CATCHES_UP**2 + stopping)
        return tuple(found)

    def _brake(self, knot: Knot, effort: float) -> float:
        """[s] of the stop from `knot`, which is in `_stop` then."""
        calm = Limits(self._limits.velocity, tuple(effort * a for a in self._acceleration), self._limits.jerk)
        problem = self._braking
        problem.current_position, problem.current_velocity, problem.current_acceleration = knot
        problem.max_velocity, problem.max_acceleration, problem.max_jerk = calm.raised_to(knot)
        result = self._planner.calculate(problem, self._stop)
        if result not in (Result.Working, Result.Finished):
            raise RuntimeError(f"ruckig finds no stop from {knot}: {result}")
        return float(self._stop.duration)

    def _next(self, knot: Knot, place: Vector, rate: Vector, dt: float) -> Knot:
        """The knot `dt` [s] after `knot`, on the way to a reference that is at `place` then and goes on at `rate`."""
        limits, problem = self._limits.raised_to(knot), self._problem
        begin = [a - v * dt for a, v in zip(place, rate, strict=True)]
        problem.current_position = [p - b for p, b in zip(knot.position, begin, strict=True)]
        problem.current_velocity = [a - v for a, v in zip(knot.velocity, rate, strict=True)]
        problem.current_acceleration = knot.acceleration
        problem.max_velocity = [top - v for top, v in zip(limits.velocity, rate, strict=True)]
        problem.min_velocity = [-top - v for top, v in zip(limits.velocity, rate, strict=True)]
        problem.max_acceleration, problem.max_jerk = limits.acceleration, limits.jerk
        output = self._output
        result = self._generator.update(problem, output)
        if result not in (Result.Working, Result.Finished):
            raise RuntimeError(f"ruckig finds no way from {knot} to {place} at {rate}: {result}")
        return Knot(
            tuple(a + p for a, p in zip(place, output.new_position, strict=True)),
            tuple(v + w for v, w in zip(rate, output.new_velocity, strict=True)),
            tuple(output.new_acceleration),
        )

    def _rate_for(self, knot: Knot, place: Vector, rate: Vector, catch_up: bool) -> Vector:
        """The reference's velocity, less of it the farther the arm is behind: with all of it, it would swing beyond
        what it cannot follow."""
        rows = zip(knot.position, place, rate, self.far(rate, catch_up), strict=True)
        return tuple(v * max(0.0, min(2.0 * (1.0 - abs(a - p) / far), 1.0)) for p, a, v, far in rows)

    def _within(self, place: Vector, rate: Vector) -> tuple[Vector, Vector]:
        """A reference that would leave a joint's travel brakes before its end and stands there."""
        places, rates = [], []
        for joint, p, v in zip(self._joints, place, rate, strict=True):
            v = max(-FASTEST * joint.velocity, min(v, FASTEST * joint.velocity))
            room = joint.upper - p if v > 0.0 else p - joint.lower
            if room <= 0.0:
                p, v = max(joint.lower, min(p, joint.upper)), 0.0
            elif math.isfinite(room):
                top = math.sqrt(2.0 * ROOM * joint.acceleration * room)
                v = max(-top, min(v, top))
            places.append(max(joint.lower, min(p, joint.upper)))
            rates.append(v)
        return tuple(places), tuple(rates)
