"""Feasibility of a trajectory for the steppers: its exact step stream against rates, pulses, torque and the queue.

The stream is the gateway's and the device's own: knots every 20 ms in 1/256 steps, cubic Hermite between them, and
floor(p + 0.5) steps made by the end of every millisecond (firmware/PROTOCOL.md, "The path").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import PlanCode, StepMargin
from gemelo.schemas.reasons import Reason, Remedy, because, remedy
from gemelo.services.planner.native.compiled import motion, where_built
from gemelo.services.planner.request.deadline import NEVER, Deadline
from gemelo.services.planner.request.per_arm import once_per_arm
from gemelo.services.planner.request.refusals import PlanRefused, refusal_of
from gemelo.services.planner.timing.profile import LONGEST, States
from gemelo.services.planner.verification.verify import states_at, states_of

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
KNOT = 0.02  # [s] between knots; standard: firmware/PROTOCOL.md
SLOT = 0.001  # [s] in which the device spreads its steps evenly; standard: firmware/PROTOCOL.md
LEAD = 0.30  # [s] of path that the gateway keeps in the queue, besides half of what braking takes
Q8 = 256  # standard: 1/256 step, firmware/PROTOCOL.md
FULL = 1.0 + 1e-3  # knots are rounded to 1/256 step, so a profile that touches its limit may look so much beyond
MOST_KNOTS = 30_000  # that are looked at at once; chosen: some tens of megabytes of slots
SLOWEST = 0.01  # time scale below which slowing down is no remedy
MOST_SHARE = 1e6  # of the pull-out torque that is told: none is left at that rate
HALVINGS = 24  # chosen: the time scale to 1 in 2^24, finer than the duration is told
PLACES = np.arange(1, round(KNOT / SLOT) + 1, dtype=np.float64) * SLOT / KNOT  # of slots between two knots, 0 to 1
SHARES: Array = PLACES[None, :, None]


@dataclass(frozen=True)
class StepStream:
    """What the device will make of a trajectory: rows are slots of 1 ms, columns joints.

    Between two knots it is first + u (start + u (square + u cube)), u from 0 to 1, in 1/256 steps; each is (k, 1, n).
    """

    first: Array
    start: Array
    square: Array
    cube: Array

    @property
    def steps(self) -> Counts:
        """(m + 1, n) executed at the slots' ends; the first row is the start."""
        path = self.first + SHARES * (self.start + SHARES * (self.square + SHARES * self.cube))
        columns = path.shape[2]
        rows = np.concatenate((self.first[:1].reshape(1, columns), path.reshape(-1, columns)))
        return np.floor(rows / Q8 + 0.5).astype(np.int64)

    @cached_property
    def rates(self) -> Array:
        """(m, n) [steps/s] of the path."""
        speed = SHARES * (SHARES * (3.0 / (KNOT * Q8) * self.cube) + 2.0 / (KNOT * Q8) * self.square)
        speed += self.start / (KNOT * Q8)
        return np.asarray(speed.reshape(-1, speed.shape[2]))

    @cached_property
    def peaks(self) -> Array:
        """(n,) [steps/s] the largest rate of each joint, forwards or backwards."""
        return peak_rates(self)

    @cached_property
    def accelerations(self) -> Array:
        """(m, n) [steps/s^2]."""
        bend = (2 * self.square + SHARES * 6 * self.cube) / KNOT**2
        return np.asarray(bend.reshape(-1, bend.shape[2]) / Q8)


def peak_rates_in_python(stream: StepStream) -> Array:
    """`peak_rates`, (n,) [steps/s], where the core is not built."""
    return np.asarray(np.maximum(stream.rates.max(axis=0), -stream.rates.min(axis=0)))


@where_built(peak_rates_in_python)
def peak_rates(stream: StepStream) -> Array:
    """(n,) [steps/s] the largest rate of each joint, forwards or backwards."""
    start, square, cube = (np.ascontiguousarray(part[:, 0]) for part in (stream.start, stream.square, stream.cube))
    return motion.peak_rates(start, square, cube, PLACES, KNOT * Q8)


def step_stream(arm: ArmDescription, trajectory: JointTrajectory, part: tuple[int, int] | None = None) -> StepStream:
    """The integer steps of `trajectory`, whose points have velocities and accelerations, played as planned.

    Of all of it, or from one knot to another.
    """
    return _stream(arm, states_of(trajectory), part)


def _stream(arm: ArmDescription, states: States, part: tuple[int, int] | None = None) -> StepStream:
    duration = float(states.times[-1])
    last = _knots(duration)
    begin, end = part or (0, last)
    samples = states_at(states, np.minimum(np.arange(begin, end + 1) * KNOT, duration))
    scale = _scale(arm)
    position = np.rint(samples.positions * scale)
    slope = np.rint(samples.velocities * scale) * KNOT
    if end == last:
        slope[-1] = 0.0
    first, start, end_slope = position[:-1, None], slope[:-1, None], slope[1:, None]
    rise = position[1:, None] - first
    return StepStream(first, start, 3 * rise - 2 * start - end_slope, start + end_slope - 2 * rise)


def margins(arm: ArmDescription, stream: StepStream) -> tuple[StepMargin, ...]:
    """How near each stepper comes to what it can do."""
    torques = (_torque_share(joint, index, stream) for index, joint in enumerate(arm.joints))
    return tuple(map(_margin, _rate_limits(arm), stream.peaks.tolist(), torques))


def demands_in_python(arm: ArmDescription, states: States, part: tuple[int, int]) -> tuple[list[float], list[float]]:
    """`demands`, where the core is not built."""
    stream = _stream(arm, states, part)
    return stream.peaks.tolist(), [_torque_share(joint, index, stream) for index, joint in enumerate(arm.joints)]


@where_built(demands_in_python)
def demands(arm: ArmDescription, states: States, part: tuple[int, int]) -> tuple[list[float], list[float]]:
    """From one knot to another of the stream through `states`: the largest rate [steps/s] of each joint, and the
    largest share of the pull-out torque of its motor."""
    last = _knots(float(states.times[-1]))
    found = motion.stream_demands(*states, _scale(arm), *_motors(arm), PLACES, *part, last, KNOT, Q8)
    rates, torques = found.tolist()
    return rates, [min(share, MOST_SHARE) for share in torques]


@once_per_arm
def _scale(arm: ArmDescription) -> Array:
    """(n,) [1/256 steps per rad or m]."""
    return np.array([joint.steps.per_unit * Q8 for joint in arm.joints])


@once_per_arm
def _motors(arm: ArmDescription) -> tuple[Array, Array]:
    """(n, 3) inertia [kg m^2], friction [Nm] and the turn of a step [rad] of each joint, and (k, 3) joint, rate
    [steps/s] and pull-out torque [Nm] of each point of their curves."""
    loads, curves = np.zeros((len(arm.joints), 3)), []
    for index, joint in enumerate(arm.joints):
        curve = joint.drive.motor.pull_out
        if curve is not None:
            loads[index] = curve.inertia, curve.friction, math.tau / joint.drive.motor.pulses_per_turn
            curves += [(index, *point) for point in zip(curve.speed, curve.torque, strict=True)]
    return loads, np.array(curves, dtype=np.float64).reshape(-1, 3)


def _margins(arm: ArmDescription, states: States) -> tuple[StepMargin, ...]:
    """Of all of it, by parts that the memory holds."""
    knots = _knots(float(states.times[-1]))
    parts = [(begin, min(begin + MOST_KNOTS, knots)) for begin in range(0, knots, MOST_KNOTS)]
    found = [tuple(map(_margin, _rate_limits(arm), *demands(arm, states, part))) for part in parts]
    if len(found) == 1:
        return found[0]
    worst = (max(of_joint, key=lambda margin: margin.share) for of_joint in zip(*found, strict=True))
    peaks = np.max([[margin.peak_rate for margin in part] for part in found], axis=0).tolist()
    return tuple(replace(margin, peak_rate=peak) for margin, peak in zip(worst, peaks, strict=True))


def _knots(duration: float) -> int:
    return max(1, math.ceil(duration / KNOT - 1e-9))


def queue_share(arm: ArmDescription, trajectory: JointTrajectory) -> float:
    """The share of the device's queue that the gateway fills to play `trajectory` at full speed."""
    return _queue_share(arm, states_of(trajectory))


def _queue_share(arm: ArmDescription, states: States) -> float:
    braking = longest_braking(states.velocities, _accelerations(arm))
    return float(LEAD + 0.5 * braking) / (arm.device.queue_capacity * KNOT)


def longest_braking_in_python(velocities: Array, accelerations: Array) -> float:
    """`longest_braking` from `velocities` (m, n) with `accelerations` (n,), where the core is not built."""
    return float((np.abs(velocities).max(axis=0) / accelerations).max())


@where_built(longest_braking_in_python)
def longest_braking(velocities: Array, accelerations: Array) -> float:
    """[s] that braking from the largest of `velocities` (m, n) takes at most, with `accelerations` (n,)."""
    return motion.longest_braking(velocities, accelerations)


@once_per_arm
def _accelerations(arm: ArmDescription) -> Array:
    """(n,) [rad/s^2] or [m/s^2] of the joints."""
    return np.array([joint.acceleration for joint in arm.joints])


STEPS_OF = {"step rate": "plan.steps.rate", "pulse width": "plan.steps.pulse_width"}  # by `StepMargin.limited_by`


def _cannot_follow(margin: StepMargin, would_do: Remedy) -> Reason:
    """The joint, and its share of what its stepper can do."""
    if margin.limited_by == "pull-out torque":
        return because("plan.steps.torque", would_do, joint=margin.name, share=margin.share)
    code, limit = STEPS_OF[margin.limited_by], margin.rate_limit
    return because(code, would_do, joint=margin.name, share=margin.share, limit=limit)


def require_feasible(
    arm: ArmDescription, trajectory: JointTrajectory, states: States | None = None
) -> tuple[StepMargin, ...]:
    """The margins; raises `PlanRefused` with the joint that cannot, and the scaling that would do. `states` are the
    points of `trajectory`, where they are at hand."""
    states = states or states_of(trajectory)
    found = _margins(arm, states)
    worst = max(found, key=lambda margin: margin.share)
    filled = _queue_share(arm, states)
    if worst.share <= FULL and filled <= 1.0:
        return found
    scale = feasible_scale(arm, trajectory)
    would_do = remedy("slow_down", scale=scale) if scale else remedy("see_robot_file")
    if worst.share > FULL:
        refusal = refusal_of(_cannot_follow(worst, would_do), worst.limited_by, worst.name, worst.share, 1.0)
        raise PlanRefused(PlanCode.PLANNING_FAILED, refusal)
    why = because("plan.device_queue", would_do, share=filled, knots=arm.device.queue_capacity)
    raise PlanRefused(PlanCode.PLANNING_FAILED, refusal_of(why, "device queue", arm.device.name, filled, 1.0))


def feasible_scale(arm: ArmDescription, trajectory: JointTrajectory, deadline: Deadline = NEVER) -> float:
    """The largest dimensionless time scale in (0, 1] that the steppers can follow, by bisection; 0.0 where none above 1
    % is, or none in a time that a plan may take; raises `PlanRefused` once the deadline has passed."""
    slowest = max(SLOWEST, trajectory.points[-1].time_from_start / LONGEST)
    if slowest >= 1.0 or not _can(arm, slowed(trajectory, slowest)):
        return 0.0
    if _can(arm, trajectory):
        return 1.0
    low, high = slowest, 1.0
    for _ in range(HALVINGS):
        deadline.check()
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _can(arm, slowed(trajectory, middle)) else (low, middle)
        if high - low < 1e-3 * low:
            break
    return low


def slowed(trajectory: JointTrajectory, scale: float) -> JointTrajectory:
    """The same path at the dimensionless `scale` in (0, 1] of its speed."""
    points = tuple(
        TrajectoryPoint(
            positions=point.positions,
            velocities=tuple(value * scale for value in point.velocities),
            accelerations=tuple(value * scale * scale for value in point.accelerations),
            time_from_start=point.time_from_start / scale,
        )
        for point in trajectory.points
    )
    return JointTrajectory(stamp=trajectory.stamp, joint_names=trajectory.joint_names, points=points)


def _can(arm: ArmDescription, trajectory: JointTrajectory) -> bool:
    states = states_of(trajectory)
    found = _margins(arm, states)
    return max(margin.share for margin in found) <= FULL and _queue_share(arm, states) <= 1.0


def _margin(most: _RateLimit, peak: float, torque: float) -> StepMargin:
    """Of a rate of `peak` [steps/s], and a share of the pull-out torque."""
    name, limit, by = most
    share = peak / limit
    if torque > share:
        share, by = torque, "pull-out torque"
    return StepMargin(name=name, peak_rate=peak, rate_limit=limit, share=share, limited_by=by)


class _RateLimit(NamedTuple):
    """The joint's name, [steps/s], and what sets it."""

    name: str
    limit: float
    by: str


@once_per_arm
def _rate_limits(arm: ArmDescription) -> list[_RateLimit]:
    """Of each joint: its own speed, one pulse in two ticks, or the driver's pulse width."""
    return [
        _RateLimit(
            joint.name,
            *min(
                (joint.velocity * joint.steps.per_unit, "step rate"),
                (arm.device.tick_hz / 2.0, "step rate"),
                (1e6 / (joint.driver.step_high_us + joint.driver.step_low_us), "pulse width"),
            ),
        )
        for joint in arm.joints
    ]


def _torque_share(joint: Joint, index: int, stream: StepStream) -> float:
    """The largest share of the pull-out torque that inertia and friction ask for; 0 for a motor without a curve.

    T = J dw/dt + friction at the motor's shaft, w = 2 pi steps / pulses_per_turn (any text on stepper selection).
    """
    curve = joint.drive.motor.pull_out
    if curve is None:
        return 0.0
    signed, accelerations = stream.rates[:, index], stream.accelerations[:, index]
    turn = math.tau / joint.drive.motor.pulses_per_turn
    needed = np.abs(curve.inertia * accelerations * turn + curve.friction * np.sign(signed))
    available = np.interp(np.abs(signed), curve.speed, curve.torque, right=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(needed > 0.0, needed / available, 0.0)
    return float(min(shares.max(), MOST_SHARE))
