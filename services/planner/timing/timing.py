"""Jerk-limited time along a smooth path: fast where it is straight, slow enough where it bends.

The path is cut into sections. Each of them is gone through as fast as its bounds allow, from the speed at its beginning
to that at its end, where the speed is steady. At last all is sped up or slowed down evenly until one joint is at one of
its limits. The compiled core does so (`native/src/timing`), numpy and ruckig where that is not built.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Trajectory

from gemelo.services.planner.native.compiled import motion, where_built
from gemelo.services.planner.path.curve import Curve, TurnsOnTheSpot, smooth_runs
from gemelo.services.planner.timing.profile import (
    MARGIN,
    MOST_POINTS,
    SPACING,
    JointLimits,
    States,
    compiled_states,
    phases_of,
    require_short,
    solved,
    stop_and_go,
)
from gemelo.services.planner.timing.sections import Section, boundary_speeds, sections_of
from gemelo.services.planner.timing.time_law import Stretch, TimeLaw

Array = NDArray[np.float64]
# Tuning constants: chosen, where a line does not say measured or standard.
SHARES = np.linspace(0.0, 1.0, 5)[1:-1]  # of a segment, at which velocities are looked at


def states_along(run: Curve, limits: JointLimits, times: Array, lengths: Array, speeds: Array, bends: Array) -> States:
    """Joint states at `times` (m,) [s], where the length [s at full speed], the speed (dimensionless) and the
    acceleration [1/s] along the path are `lengths`, `speeds` and `bends` (m,)."""
    derivatives = run.at(lengths)
    first, second, scale = derivatives.first, derivatives.second, limits.velocity
    velocities = first * speeds[:, None]
    accelerations = second * (speeds * speeds)[:, None] + first * bends[:, None]
    return States(times, derivatives.value * scale, velocities * scale, accelerations * scale)


def timed_path_in_python(control: Array, limits: JointLimits) -> States:
    """`timed_path` along `control` (k, n) [rad] or [m] where the core is not built; raises `NoProfile` and
    `TurnsOnTheSpot`."""
    return along_runs(control, limits, _run_states)


@where_built(timed_path_in_python)
def timed_path(control: Array, limits: JointLimits) -> States:
    """From rest to rest along the uniform cubic B-spline of `control` (k, n) [rad] or [m], both ends exact; raises
    `NoProfile`.

    At corners it stops. Raises `TurnsOnTheSpot` where the curve does so without a corner.
    """
    try:
        return compiled_states(lambda: motion.timed_curve(np.ascontiguousarray(control), *limits.rows))
    except motion.TurnsOnTheSpot as error:
        raise TurnsOnTheSpot(str(error)) from error


def along_runs(
    control: Array, limits: JointLimits, timed: Callable[[Curve, JointLimits], States], with_jerk: bool = True
) -> States:
    """The states through every smooth run of the curve of `control` (k, n) [rad] or [m], each timed by `timed` from
    rest to rest, as fast as the limits allow; raises `NoProfile`."""
    require_short(float((np.abs(np.diff(control, axis=0)) / limits.velocity).max(axis=1).sum()))
    runs: list[States] = []
    clock = 0.0
    for run in smooth_runs(control, limits.velocity):
        states = timed(run, limits)
        runs.append(states._replace(times=states.times + clock))
        clock = float(runs[-1].times[-1])
    if not runs:
        return stop_and_go(control[[0, -1]], limits)
    whole = States(*(np.concatenate(columns) for columns in zip(*runs, strict=True)))
    kept = np.concatenate(([True], np.diff(whole.times) > 0.0))
    states = States(*(column[kept] for column in whole))
    states.positions[0], states.positions[-1] = control[0], control[-1]
    states.velocities[[0, -1]] = states.accelerations[[0, -1]] = 0.0
    states = at_limits(states, limits, with_jerk)
    require_short(float(states.times[-1]))
    return states


def at_limits(states: States, limits: JointLimits, with_jerk: bool) -> States:
    """The same path in the time in which the joint that is asked most of is just within its limits."""
    velocity, acceleration, jerk = peak_shares(*states, limits)
    most = max(velocity, acceleration**0.5, jerk ** (1.0 / 3.0) if with_jerk else 0.0)
    return states if most == 0.0 else at_speed(states, MARGIN / most)


def at_speed(states: States, scale: float) -> States:
    """The same path at `scale` times the speed; `scale` is dimensionless."""
    times, positions, velocities, accelerations = states
    return States(times / scale, positions, velocities * scale, accelerations * scale * scale)


def _run_states(run: Curve, limits: JointLimits) -> States:
    """Of one run, from its beginning; the points stand where a piece begins, too, so that none bridges two of them."""
    law = TimeLaw(stretches_through(sections_of(run, limits)))
    times = law.times(run.knots[1:-1], max(SPACING, law.duration / MOST_POINTS))
    return states_along(run, limits, times, *law.at(times))


def stretches_through(sections: list[Section]) -> Iterator[Stretch]:
    """Of steady jerk, through all sections; raises `NoProfile`."""
    speeds, travelled = boundary_speeds(sections), 0.0
    for section, before, after in zip(sections, speeds[:-1], speeds[1:], strict=True):
        for phase in phases_of(_through(section, before, after)):
            yield phase._replace(length=travelled + phase.length)
        travelled += section.length


def _through(section: Section, before: float, after: float) -> Trajectory:
    """From one steady speed to another through a section."""
    demand = InputParameter(1)
    demand.current_velocity, demand.target_velocity = [before], [after]
    demand.target_position = [section.length]
    demand.max_velocity, demand.max_acceleration = [section.speed], [section.acceleration]
    demand.max_jerk = [section.jerk]
    return solved(demand, section.length)


def peak_shares(stamps: Array, p: Array, v: Array, a: Array, limits: JointLimits) -> tuple[float, float, float]:
    """The largest shares of any joint's limits, at `stamps` (m,) [s] with positions, velocities, accelerations (m, n).

    Jerk and acceleration are taken where their derivatives are zero; to a velocity comes what it may gain between two
    looks. The coefficients are those of Biagiotti and Melchiorri 2008, section 2.1.
    """
    dt = np.diff(stamps)[:, None]
    v0, v1, a0, a1 = v[:-1] * dt, v[1:] * dt, a[:-1] * dt * dt, a[1:] * dt * dt
    rise, climb, bend = p[1:] - p[:-1] - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    third, fourth, fifth = (
        10.0 * rise - 4.0 * climb + 0.5 * bend,
        -15.0 * rise + 7.0 * climb - bend,
        6.0 * rise - 3.0 * climb + 0.5 * bend,
    )
    c0, c1, c2 = 6.0 * third, 24.0 * fourth, 60.0 * fifth  # of the jerk, by powers of the segment's share
    with np.errstate(divide="ignore", invalid="ignore"):
        summit = _inside(-c1 / (2.0 * c2))
        root = np.sqrt(c1 * c1 - 4.0 * c0 * c2)
        still = [_inside((side * root - c1) / (2.0 * c2)) for side in (1.0, -1.0)] + [_inside(-c0 / c1)]
    jerk = np.maximum(np.abs(c0), np.abs(c0 + c1 + c2))
    jerk = np.maximum(jerk, np.abs(c0 + summit * (c1 + summit * c2)))
    acceleration = np.maximum(np.abs(a0), np.abs(a1))
    for u in still:
        acceleration = np.maximum(acceleration, np.abs(a0 + u * (c0 + u * (c1 / 2.0 + u * c2 / 3.0))))
    velocity = np.maximum(np.abs(v0), np.abs(v1))
    for u in SHARES.tolist():
        velocity = np.maximum(velocity, np.abs(v0 + u * (a0 + u * (c0 / 2.0 + u * (c1 / 6.0 + u * c2 / 12.0)))))
    velocity = velocity + jerk * (SHARES[0] ** 2 / 8.0)
    return (
        float((velocity / dt / limits.velocity).max()),
        float((acceleration / dt**2 / limits.acceleration).max()),
        float((jerk / dt**3 / limits.jerk).max()),
    )


def _inside(shares: Array) -> Array:
    """The shares within the segment; 0 for the others, and for what is no number."""
    inside: Array = np.where((shares > 0.0) & (shares < 1.0), shares, 0.0)
    return inside
