"""Time-optimal timing by toppra, without a jerk limit: along the very curve that was found free.

toppra is given that curve by its length, not a spline of its own through points, which would stray from it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.curve import Curve
from gemelo.services.planner.path.path_curve import PathCurve
from gemelo.services.planner.timing.profile import JointLimits, States
from gemelo.services.planner.timing.timing import along_runs, states_along
from gemelo.services.planner.timing.toppra_speeds import optimal_speeds

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
GRID = 500  # grid points at least; chosen: much finer than the curvature of a rounded path
BLUR = 0.03  # [s] in which an acceleration comes and goes; chosen: one and a half knots of the gateway
SPACING = 0.01  # [s] between points; chosen: a third of the blur
FEWEST = 40  # points of a run; chosen: the blur of a short run still has shape
MOST = 4000  # points of a run; chosen: small enough as a message


def time_optimal_path(control: Array, limits: JointLimits) -> States:
    """The states along the B-spline of `control` (k, n) [rad] or [m], as `timing.timed_path`, but without jerk
    limits; raises `NoProfile`."""
    return along_runs(control, limits, _run_states, with_jerk=False)


def time_optimal_law(curve: PathCurve, limits: JointLimits, tool: tuple[float, float] = (0.0, 0.0)) -> BlurredLaw:
    """When the curve is how long, as fast as velocities and accelerations allow; raises `NoProfile`.

    `tool` is its speed [m/s] and acceleration [m/s^2], 0 for no limit; its position is in the columns behind the
    joints.
    """
    end = float(curve.knots[-1])
    grid = np.unique(np.concatenate((np.linspace(0.0, 1.0, GRID), curve.knots / end)))
    _, first, second, _ = curve.at(grid * end)
    speeds = optimal_speeds(grid, end * first, end * end * second, limits, tool)
    return BlurredLaw(end * grid, end * speeds)


def _run_states(run: Curve, limits: JointLimits) -> States:
    of_one = JointLimits(np.ones_like(limits.velocity), limits.acceleration / limits.velocity, limits.jerk)
    law = time_optimal_law(run, of_one)
    times = law.times(run.knots[1:-1], SPACING)
    return states_along(run, limits, times, *law.at(times))


class BlurredLaw:
    """A steady acceleration between the points of a grid, its length then the mean over a short time: accelerations do
    not jump, at the ends neither."""

    def __init__(self, grid: Array, speeds: Array) -> None:
        """`speeds` (m,) [1/s] at the lengths `grid` (m,)."""
        steps = 2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])
        areas = steps * (grid[:-1] + steps * (2.0 * speeds[:-1] + speeds[1:]) / 6.0)
        self._grid, self._speeds = grid, speeds
        self._bends = np.append(np.diff(speeds) / steps, 0.0)
        self._stamps = np.concatenate(([0.0], np.cumsum(steps)))
        self._areas = np.concatenate(([0.0], np.cumsum(areas)))
        self._blur = max(BLUR, 3.0 * float(self._stamps[-1]) / MOST)
        self.duration = float(self._stamps[-1]) + self._blur

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """(m,) length, speed and acceleration at `times` (m,) [s]."""
        now, before = self._sharp(times), self._sharp(times - self._blur)
        length, speed, bend = ((one - other) / self._blur for one, other in zip(now, before, strict=True))
        return length, speed, bend

    def times(self, lengths: Array, spacing: float) -> Array:
        """Even times [s] from 0 to the end, at most `spacing` [s] and the blur's own apart; `lengths` set none."""
        spacing = min(spacing, self._blur * SPACING / BLUR)
        count = int(np.clip(round(self.duration / spacing), FEWEST, MOST))
        return np.linspace(0.0, self.duration, count + 1)

    def _sharp(self, times: Array) -> tuple[Array, Array, Array]:
        """The integral of the length over time, the length, the speed (m,); at rest before and afterwards."""
        times = np.clip(times, 0.0, None)
        row = np.searchsorted(self._stamps, times, side="right") - 1
        t, s, v, a = times - self._stamps[row], self._grid[row], self._speeds[row], self._bends[row]
        area = self._areas[row] + t * (s + t * (v / 2.0 + t * a / 6.0))
        return area, s + t * (v + t * a / 2.0), v + t * a
