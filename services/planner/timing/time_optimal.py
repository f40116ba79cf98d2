"""Time-optimal timing by toppra, without a jerk limit: along the very curve that was found free.

toppra is given that curve by its length, not a spline of its own through points, which would stray from it. It reaches
its limits between its grid points too, so it gets smaller ones.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.motion import JointTrajectory
from services.planner.search.curve import Curve
from services.planner.timing.profile import JointLimits, NoProfile
from services.planner.timing.timing import States, along_runs, states_along

Array = NDArray[np.float64]

GRID = 500  # grid points at least
DERATED = 0.95  # share of the limits that toppra may use
BLUR = 0.03  # [s] in which an acceleration comes and goes
SPACING = 0.01  # [s] between points
FEWEST = 40  # points of a run
MOST = 4000


def time_optimal_way(names: Sequence[str], control: Array, limits: JointLimits) -> JointTrajectory:
    """As `timing.timed_way`, as fast as velocities and accelerations allow; raises `NoProfile`."""
    return along_runs(names, control, limits, _run_states, with_jerk=False)


def _run_states(run: Curve, limits: JointLimits) -> States:
    """The length along the way is its mean over `BLUR`, so that accelerations do not jump, at the ends neither."""
    law = _Law(*_speeds(run, limits))
    duration = law.duration + BLUR
    count = int(np.clip(round(duration / SPACING), FEWEST, MOST))
    times = np.linspace(0.0, duration, count + 1)
    now, before = law.at(times), law.at(times - BLUR)
    lengths, speeds, bends = ((one - other) / BLUR for one, other in zip(now, before, strict=True))
    return states_along(run, limits, times, lengths, speeds, bends)


class _Law:
    """The movement along a way with a steady acceleration between the points of a grid."""

    def __init__(self, grid: Array, speeds: Array) -> None:
        steps = 2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])
        areas = steps * (grid[:-1] + steps * (2.0 * speeds[:-1] + speeds[1:]) / 6.0)
        self._grid, self._speeds = grid, speeds
        self._bends = np.append(np.diff(speeds) / steps, 0.0)
        self._stamps = np.concatenate(([0.0], np.cumsum(steps)))
        self._areas = np.concatenate(([0.0], np.cumsum(areas)))
        self.duration = float(self._stamps[-1])

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """The integral of the length over time, the length, the speed (m,); at rest before and afterwards."""
        times = np.clip(times, 0.0, None)
        row = np.searchsorted(self._stamps, times, side="right") - 1
        t, s, v, a = times - self._stamps[row], self._grid[row], self._speeds[row], self._bends[row]
        area = self._areas[row] + t * (s + t * (v / 2.0 + t * a / 6.0))
        return area, s + t * (v + t * a / 2.0), v + t * a


def _speeds(run: Curve, limits: JointLimits) -> tuple[Array, Array]:
    """Lengths and the speeds there [1], from toppra."""
    toppra = load_toppra()
    most = DERATED * np.ones_like(limits.velocity)
    bends = DERATED * limits.acceleration / limits.velocity
    constraints = [
        toppra.constraint.JointVelocityConstraint(np.column_stack((-most, most))),
        toppra.constraint.JointAccelerationConstraint(np.column_stack((-bends, bends))),
    ]
    grid = np.unique(np.concatenate((np.linspace(0.0, run.length, GRID), run.knots)))
    path = _path_class()(run, len(limits.velocity))
    instance = toppra.algorithm.TOPPRA(constraints, path, gridpoints=grid, parametrizer="ParametrizeConstAccel")
    _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
    if speeds is None or not np.isfinite(speeds).all() or (speeds[1:-1] <= 0.0).any():
        raise NoProfile("toppra found no way through its limits: ask for the jerk-limited timing")
    return grid, np.asarray(speeds, dtype=np.float64)


@cache
def load_toppra() -> Any:
    """Imported where it is needed: it takes seconds, and its sources have strings that Python warns about."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import toppra
        import toppra.algorithm
        import toppra.constraint

    toppra.setup_logging("ERROR")
    return toppra


@cache
def _path_class() -> type[Any]:
    from toppra.interpolator import AbstractGeometricPath

    class CurvePath(AbstractGeometricPath):  # type: ignore[misc]
        """The curve as toppra wants it; values are divided by the speed limits."""

        def __init__(self, run: Curve, dof: int) -> None:
            self._run, self._dof = run, dof

        def __call__(self, lengths: Any, order: int = 0) -> Any:
            values = self._run.at(np.atleast_1d(np.asarray(lengths, dtype=np.float64)))[order]
            return values if np.ndim(lengths) else values[0]

        @property
        def dof(self) -> int:
            return self._dof

        @property
        def path_interval(self) -> Array:
            return np.array([0.0, self._run.length])

        @property
        def waypoints(self) -> None:
            return None

    return CurvePath
