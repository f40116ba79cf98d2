"""The finished trajectory, looked at densely before anybody may have it: limits, continuity, collisions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import chain, pairwise
from operator import lt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.reasons import because
from gemelo.services.planner.native.compiled import motion, where_built
from gemelo.services.planner.request.per_arm import once_per_arm
from gemelo.services.planner.timing.profile import JointLimits, States

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
DENSITY = 10  # samples between two points; chosen: a quintic between two points 0.05 s apart bends little in 5 ms
ROUNDING = 1e-9  # [rad] or [m], and a share of limits: what floating point may add

PER_TIME = {"position": "", "velocity": "/s", "acceleration": "/s2"}  # behind a joint's unit
LOOSE_JERK = 1.01  # share of the limit; chosen: third differences of neighbouring points have few digits left


class BadTrajectory(ReasonedError, ValueError):
    """A trajectory that must not be executed; the reason names the joint, the value and the limit."""


@dataclass(frozen=True)
class Samples:
    """Rows in time: `times` (m,) [s] and positions, velocities, accelerations, jerks (m, n)."""

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    jerks: Array


class SampledStates(NamedTuple):
    """`positions` (m, n) of samples, and what they all have `reached`, (5, n): the least and the largest position, and
    the largest size of each derivative."""

    positions: Array
    reached: Array


def look_in_python(states: States) -> SampledStates:
    """`look`, where the core is not built."""
    samples = sample_between(*states)
    sizes = (np.abs(rows).max(axis=0) for rows in (samples.velocities, samples.accelerations, samples.jerks))
    reached = np.array((samples.positions.min(axis=0), samples.positions.max(axis=0), *sizes))
    return SampledStates(samples.positions, reached)


@where_built(look_in_python)
def look(states: States) -> SampledStates:
    """At the samples of `sample_between`, in a tenth of the time: most trajectories are within their limits, and then
    nobody asks where they come nearest to them."""
    return SampledStates(*motion.sampled(*states, _shares(DENSITY)))


def aside_in_python(line: Array, rows: Array) -> float:
    """`aside` [rad] or [m] of `line` (2, n) and `rows` (m, n), where the core is not built."""
    way = line[1] - line[0]
    squared = float(way @ way)
    shares = np.clip((rows - line[0]) @ way / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(rows))
    return float(np.abs(rows - (line[0] + shares[:, None] * way)).max())


@where_built(aside_in_python)
def aside(line: Array, rows: Array) -> float:
    """[rad] or [m] that any joint is beside the line between two rows (2, n), in any of `rows` (m, n)."""
    return float(motion.most_aside(line, rows))


def sample(trajectory: JointTrajectory, density: int = DENSITY) -> Samples:
    """The quintic through the points at `density` instants a segment, all at once, with both ends of every segment."""
    return sample_between(*states_of(trajectory), density)


def sample_between(stamps: Array, p: Array, v: Array, a: Array, density: int = DENSITY) -> Samples:
    """As `sample`, through positions, velocities and accelerations (m, n) at `stamps` (m,) [s]."""
    times = (stamps[:-1, None] + _shares(density) * (stamps[1:] - stamps[:-1])[:, None]).reshape(-1)
    return evaluated(States(stamps, p, v, a), times, np.arange(len(times)) // (density + 1))


@cache
def _shares(density: int) -> Array:
    """(density + 1,) from 0 to 1."""
    return np.linspace(0.0, 1.0, density + 1)


def at_times(trajectory: JointTrajectory, times: Array) -> Samples:
    """The quintic through the points at `times` (m,) [s], which lie within the trajectory."""
    return states_at(states_of(trajectory), times)


def states_at(states: States, times: Array) -> Samples:
    """As `at_times`, through `states` at `times` (m,) [s]."""
    index = np.clip(np.searchsorted(states.times, times, side="right") - 1, 0, len(states.times) - 2)
    return evaluated(states, times, index)


def states_of(trajectory: JointTrajectory) -> States:
    """The points of `trajectory` as arrays."""
    points = trajectory.points
    stamps = np.array([point.time_from_start for point in points])
    p = _rows(len(points), (point.positions for point in points))
    v = _rows(len(points), (point.velocities for point in points))
    a = _rows(len(points), (point.accelerations for point in points))
    return States(stamps, p, v, a)


def _rows(count: int, rows: Iterable[tuple[float, ...]]) -> Array:
    """(count, n): much faster than numpy makes an array of tuples."""
    return np.fromiter(chain.from_iterable(rows), dtype=np.float64).reshape(count, -1)


def evaluated_in_python(states: States, times: Array, index: NDArray[np.int64]) -> Samples:
    """`evaluated` at `times` (m,) [s], segments `index` (m,), where the core is not built."""
    stamps, p, v, a = states
    dt = np.diff(stamps)[index][:, None]
    u = (times - stamps[index])[:, None] / dt
    p0, v0, a0 = p[index], v[index] * dt, a[index] * dt * dt
    rise = p[index + 1] - p0 - v0 - 0.5 * a0
    climb, bend = v[index + 1] * dt - v0 - a0, a[index + 1] * dt * dt - a0
    third = 10 * rise - 4 * climb + bend / 2
    fourth = -15 * rise + 7 * climb - bend
    fifth = 6 * rise - 3 * climb + bend / 2
    positions = p0 + u * (v0 + u * (a0 / 2 + u * (third + u * (fourth + u * fifth))))
    velocities = (v0 + u * (a0 + u * (3 * third + u * (4 * fourth + u * 5 * fifth)))) / dt
    accelerations = (a0 + u * (6 * third + u * (12 * fourth + u * 20 * fifth))) / dt**2
    jerks = (6 * third + u * (24 * fourth + u * 60 * fifth)) / dt**3
    return Samples(times, positions, velocities, accelerations, jerks)


@where_built(evaluated_in_python)
def evaluated(states: States, times: Array, index: NDArray[np.int64]) -> Samples:
    """At `times` (m,) [s], each in the segment `index` (m,) (Biagiotti and Melchiorri 2008, section 2.1)."""
    times, (stamps, p, v, a) = np.ascontiguousarray(times), states
    return Samples(times, *motion.quintics(stamps, p, v, a, times, np.ascontiguousarray(index, dtype=np.int64)))


def limit_shares(samples: Samples, limits: JointLimits) -> tuple[float, float, float]:
    """The largest share of any joint's velocity, acceleration and jerk limits."""
    velocity = np.abs(samples.velocities) / limits.velocity
    acceleration = np.abs(samples.accelerations) / limits.acceleration
    jerk = np.abs(samples.jerks) / limits.jerk
    return float(velocity.max()), float(acceleration.max()), float(jerk.max())


def is_within_in_python(reached: Array, most: Array) -> bool:
    """`is_within` of `reached` and `most`, (5, n) each, where the core is not built."""
    return bool((reached[0] >= most[0]).all() and (reached[1:] <= most[1:]).all())


@where_built(is_within_in_python)
def is_within(reached: Array, most: Array) -> bool:
    """True if `reached` (5, n), as of `SampledStates`, is within `most` (5, n); what is not a number is not."""
    return motion.is_within(reached, most)


def require_limits(
    arm: ArmDescription, states: States, seen: SampledStates, limits: JointLimits, is_jerk_limited: bool
) -> None:
    """`require_within_limits` and, where it is jerk-limited, `require_jerk` of the trajectory through `states`, at
    which `seen` has looked; raises `BadTrajectory`."""
    if not is_within(seen.reached, _most(arm, limits, is_jerk_limited)):
        samples = sample_between(*states)
        require_within_limits(arm, samples, limits)
        if is_jerk_limited:
            require_jerk(arm, samples, limits)


@once_per_arm
def _most(arm: ArmDescription, limits: JointLimits, is_jerk_limited: bool) -> Array:
    """(5, n) that each row of `SampledStates.reached` may be, the first at least and the others at most."""
    lower, upper = _bounds(arm)
    loose = 1.0 + ROUNDING
    jerk = LOOSE_JERK * limits.jerk if is_jerk_limited else np.full(len(lower), np.inf)
    return np.array((lower, upper, loose * limits.velocity, loose * limits.acceleration, jerk))


@once_per_arm
def _bounds(arm: ArmDescription) -> tuple[Array, Array]:
    """Where positions may be, (n,) each [rad] or [m]."""
    lower = np.array([joint.lower for joint in arm.joints]) - ROUNDING
    return lower, np.array([joint.upper for joint in arm.joints]) + ROUNDING


def require_within_limits(arm: ArmDescription, samples: Samples, limits: JointLimits) -> None:
    """Position, velocity and acceleration of every sample; raises `BadTrajectory`."""
    lower, upper = _bounds(arm)
    loose = 1.0 + ROUNDING
    checks = (
        ("position", np.maximum(samples.positions - upper, lower - samples.positions), samples.positions),
        ("velocity", np.abs(samples.velocities) - loose * limits.velocity, samples.velocities),
        ("acceleration", np.abs(samples.accelerations) - loose * limits.acceleration, samples.accelerations),
    )
    for what, excess, values in checks:
        if not float(excess.max()) <= 0.0:  # what is not a number is not within its limits
            row, column = np.unravel_index(int(excess.argmax()), excess.shape)
            value, over, t = values[row, column], excess[row, column], samples.times[row]
            name = arm.joint_names[int(column)]
            unit = arm.joints[int(column)].unit + PER_TIME[what]
            figures = {"value": float(value), "beyond": float(over), "time": float(t)}
            raise BadTrajectory(because("plan.verify.limit", quantity=what, joint=name, unit=unit, **figures))


def require_jerk(arm: ArmDescription, samples: Samples, limits: JointLimits) -> None:
    """Of every sample of a jerk-limited trajectory; raises `BadTrajectory`."""
    share = np.abs(samples.jerks) / limits.jerk
    if not float(share.max()) <= LOOSE_JERK:
        row, column = np.unravel_index(int(share.argmax()), share.shape)
        name, t = arm.joint_names[int(column)], samples.times[row]
        most = float(share[row, column])
        raise BadTrajectory(because("plan.verify.jerk", joint=name, share=most, time=float(t)))


def require_ends(trajectory: JointTrajectory, start: tuple[float, ...], goal: tuple[float, ...]) -> None:
    """Raises `BadTrajectory` unless the trajectory leads exactly from `start` to `goal`, (n,) [rad] or [m], at rest at
    both, with increasing times."""
    times = [point.time_from_start for point in trajectory.points]
    if not all(map(lt, times, times[1:])):
        before, after = next(pair for pair in pairwise(times) if not lt(*pair))
        raise BadTrajectory(because("plan.verify.times", before=before, after=after))
    first, last = trajectory.points[0], trajectory.points[-1]
    if first.positions != start or last.positions != goal or first.time_from_start != 0.0:
        raise BadTrajectory(because("plan.verify.ends"))
    if any(first.velocities + first.accelerations + last.velocities + last.accelerations):
        raise BadTrajectory(because("plan.verify.rest"))
