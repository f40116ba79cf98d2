"""Time along a straight line of the joints: jerk-limited, every joint at the same share of its path at every moment.

One variable is timed, the path along the line; the joints follow in proportion. That is phase synchronisation without
its exception: ruckig's own falls back to curved lines where another joint's limit would be exceeded. The compiled core
(`native/src/timing`) has the movement in closed form, ruckig finds the same where that is not built.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.schemas.reasons import because
from gemelo.services.planner.native.compiled import motion, where_built
from gemelo.services.planner.request.per_arm import once_per_arm

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SPACING = 0.05  # [s] between points, where the profile does not change its jerk; measured: README.md
MOST_POINTS = 400  # chosen: small as a message; verification looks between them
SHORTEST = 1e-4  # [s] two points nearer than that are one: below it the quintic's coefficients lose their digits
MARGIN = 0.997  # share of the limits that is used, for what SHORTEST leaves out
LONGEST = 86_400.0  # [s] a plan may take: beyond a day the scaling is a mistake
STANDSTILL = 1e-9  # [s] at full speed: a path so short is no way
NEGLIGIBLE = 1e-12  # share of its full speed below which a joint limits nothing
NO_TIME = 1e-12  # [s] a phase that is shorter is none; chosen: rounding of times
HOLD = 0.1  # [s] that a plan to where the arm already is takes


class NoProfile(ReasonedError, ValueError):
    """A path gets no time; the reason says of which, or what the library says."""


@dataclass(frozen=True)
class JointLimits:
    """(n,) each: [rad/s] or [m/s], and their derivatives."""

    velocity: Array
    acceleration: Array
    jerk: Array

    @property
    def rows(self) -> tuple[Array, Array, Array]:
        """(n,) each, as the compiled core takes them."""
        return self.velocity, self.acceleration, self.jerk


def joint_limits(arm: ArmDescription, velocity_scaling: float = 1.0, acceleration_scaling: float = 1.0) -> JointLimits:
    """The arm's limits (n,), in [rad] or [m] per s, s^2 and s^3; the scalings are dimensionless. The acceleration's
    scaling applies to the jerk as well, so that its ramp keeps its duration."""
    full = _full_limits(arm)
    if velocity_scaling == acceleration_scaling == 1.0:
        return full
    return JointLimits(
        velocity=velocity_scaling * full.velocity,
        acceleration=acceleration_scaling * full.acceleration,
        jerk=acceleration_scaling * full.jerk,
    )


@once_per_arm
def _full_limits(arm: ArmDescription) -> JointLimits:
    return JointLimits(
        velocity=np.array([joint.velocity for joint in arm.joints]),
        acceleration=np.array([joint.acceleration for joint in arm.joints]),
        jerk=np.array([joint.jerk for joint in arm.joints]),
    )


class States(NamedTuple):
    """`times` (m,) [s], and joint values and their derivatives (m, n) there."""

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array


def tuples_in_python(rows: Array) -> list[tuple[float, ...]]:
    """`tuples` of `rows` (m, n), where the core is not built."""
    return list(map(tuple, rows.tolist()))


@where_built(tuples_in_python)
def tuples(rows: Array) -> list[tuple[float, ...]]:
    """The numbers of `rows` (m, n), as messages have them."""
    return motion.tuples(np.ascontiguousarray(rows))


def trajectory_of(names: Sequence[str], states: States) -> JointTrajectory:
    """The states as points."""
    times, *columns = states
    points = [
        TrajectoryPoint(positions=p, velocities=v, accelerations=a, time_from_start=t)
        for t, p, v, a in zip(times.tolist(), *map(tuples, columns), strict=True)
    ]
    return JointTrajectory(joint_names=tuple(names), points=tuple(points))


def straight_line(
    names: Sequence[str], start: Sequence[float], goal: Sequence[float], limits: JointLimits
) -> JointTrajectory:
    """From rest to rest, `start` and `goal` (n,) [rad] or [m] exact to the bit; raises `NoProfile`.

    The points stand wherever the profile's jerk changes, and between, so that the quintic through them IS the profile.
    """
    return trajectory_of(names, stop_and_go(np.array((start, goal)), limits))


def stop_and_go_in_python(corners: Array, limits: JointLimits) -> States:
    """`stop_and_go` through `corners` (m, n) [rad] or [m] where the core is not built; raises `NoProfile`."""
    legs, began = [_rest(corners[0], 0.0)], 0.0
    for start, goal in pairwise(corners):
        legs += _leg(start, goal, limits, began)
        began = float(legs[-1].times[-1])
    return States(*(np.concatenate(columns) for columns in zip(*legs, strict=True)))


@where_built(stop_and_go_in_python)
def stop_and_go(corners: Array, limits: JointLimits) -> States:
    """From corner to corner of the polyline (m, n) [rad] or [m], each leg as `straight_line`, at rest at all of them;
    raises `NoProfile`."""
    try:
        return compiled_states(lambda: motion.timed_lines(np.ascontiguousarray(corners), *limits.rows))
    except NoProfile:
        moves = np.abs(np.diff(corners, axis=0))
        require_short(max(float((moves / limits.velocity).max()), float((moves / limits.acceleration).max()) ** 0.5))
        raise


def compiled_states(timed: Callable[[], tuple[Array, Array, Array, Array]]) -> States:
    """What the compiled core returns: times (m,) [s] and rows (m, n); raises `NoProfile` for its own."""
    try:
        return States(*timed())
    except motion.NoProfile as error:
        raise NoProfile(because("plan.timing.core", detail=str(error))) from error


def _leg(start: Array, goal: Array, limits: JointLimits, began: float) -> list[States]:
    """What comes after `start`, where the leg begins at the time `began` [s]."""
    displacement = goal - start
    length = float(np.max(np.abs(displacement) / limits.velocity))  # [s] at full speed
    if length < STANDSTILL:
        return [_rest(goal, began + HOLD)]
    require_short(max(length, float(np.max(np.abs(displacement) / limits.acceleration)) ** 0.5))
    direction = displacement / length
    profile, changes = _time_line(length, direction, limits)
    inner = _inner_states(start, direction, profile, _times(changes, profile.duration), began)
    return [inner, _rest(goal, began + profile.duration)]


def require_short(lasts: float) -> None:
    """Raises `NoProfile` for a path that takes at least so long [s]."""
    if not lasts <= LONGEST:
        raise NoProfile(because("plan.timing.too_long", time=lasts, most=LONGEST))


def _time_line(length: float, direction: Array, limits: JointLimits) -> tuple[Trajectory, list[float]]:
    """The profile of the path [s at full speed], and the times [s] at which its jerk changes."""
    share = np.abs(direction)
    moving = share > NEGLIGIBLE * limits.velocity
    demand = InputParameter(1)
    demand.target_position = [length]
    demand.max_velocity = [MARGIN * float(np.min(limits.velocity[moving] / share[moving]))]
    demand.max_acceleration = [MARGIN * float(np.min(limits.acceleration[moving] / share[moving]))]
    demand.max_jerk = [MARGIN * float(np.min(limits.jerk[moving] / share[moving]))]
    profile = solved(demand, length)
    return profile, list(accumulate(phase.duration for phase in phases_of(profile)))


def solved(demand: InputParameter, length: float) -> Trajectory:
    """ruckig's profile for `demand`, a stretch of `length` [s] at full speed; raises `NoProfile`."""
    profile = Trajectory(1)
    try:
        result = Ruckig(1).calculate(demand, profile)
    except RuckigError as error:
        raise NoProfile(because("plan.timing.none", length=length)) from error
    if result not in (Result.Working, Result.Finished):
        raise NoProfile(because("plan.timing.ruckig", length=length, result=result.name))
    return profile


class ProfilePhase(NamedTuple):
    """Of steady jerk: how long it lasts [s], and the length, its derivatives and the jerk at its begin."""

    duration: float
    length: float
    speed: float
    acceleration: float
    jerk: float


def phases_of(profile: Trajectory) -> list[ProfilePhase]:
    """The profile of one variable, from one change of its jerk to the next."""
    found = profile.profiles[0][0]
    phases: list[ProfilePhase] = []
    for row in zip(found.t, found.p, found.v, found.a, found.j, strict=False):
        phase = ProfilePhase(*row)
        if phase.duration <= NO_TIME:
            continue
        if phases and phases[-1].jerk == phase.jerk:
            phases[-1] = phases[-1]._replace(duration=phases[-1].duration + phase.duration)
        else:
            phases.append(phase)
    return phases


def _times(changes: Sequence[float], duration: float) -> list[float]:
    """Times [s] strictly inside, ascending: the jerk's changes, and a grid between them."""
    spacing = max(SPACING, duration / MOST_POINTS)
    times: list[float] = []
    last = 0.0
    for change in [*changes, duration]:
        if change - last < SHORTEST or (change < duration and duration - change < SHORTEST):
            continue
        parts = max(1, round((change - last) / spacing))
        times += [last + (change - last) * part / parts for part in range(1, parts + 1)]
        last = change
    return [t for t in times if t < duration - 0.5 * SHORTEST]


def _inner_states(start: Array, direction: Array, profile: Trajectory, times: list[float], began: float) -> States:
    """The profile at `times` [s], spread over the joints; told later by `began`."""
    rows = np.array([profile.at_time(t) for t in times]).reshape(len(times), 3, 1) * direction  # (m, 3, n)
    return States(began + np.array(times), start + rows[:, 0], rows[:, 1], rows[:, 2])


def _rest(positions: Array, t: float) -> States:
    zeros = np.zeros((1, len(positions)))
    return States(np.array([t]), positions[None], zeros, zeros)
