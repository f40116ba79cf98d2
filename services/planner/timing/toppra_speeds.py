"""The highest speeds along a path, by toppra.

It reaches its limits between its grid points too, so it gets smaller ones. Its figures are kept near 1, however slow
the arm is to be: the path is as long as 1, and a unit of time is about what the path takes.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.timing.profile import JointLimits, NoProfile, require_short

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
DERATED = 0.95  # share of the limits that toppra may use; chosen: the blur afterwards swings over them a little
SHORTEST = 0.03  # [s] that a unit of time has at least; chosen: as long as the blur
MUCH = 1e4  # of a normalised limit: beyond it nothing is limited
SIDES = 16  # of the polygon in half a circle: what the tool's acceleration along and across its way may be


def optimal_speeds(grid: Array, first: Array, second: Array, limits: JointLimits, tool: tuple[float, float]) -> Array:
    """(m,) [1/s] at `grid` (m,) of a path of length 1, by its derivatives (m, k) there; raises `NoProfile`.

    `tool` is its speed [m/s] and acceleration [m/s^2], 0 for no limit; its position is in the columns behind the
    joints.
    """
    return _Task(grid, first, second, limits, tool).speeds()


@dataclass(frozen=True)
class _Task:
    """For toppra."""

    grid: Array
    first: Array
    second: Array
    limits: JointLimits
    tool: tuple[float, float]

    def speeds(self) -> Array:
        """The speeds (m,) [1/s] at the grid; raises `NoProfile`."""
        toppra = load_toppra()
        unit, joints = self._unit(), len(self.limits.velocity)
        scale = np.abs(self.first[:, :joints]).max(axis=0)
        scale[scale == 0.0] = 1.0
        velocity = np.minimum(DERATED * self.limits.velocity * unit / scale, MUCH)
        acceleration = np.minimum(DERATED * self.limits.acceleration * unit**2 / scale, MUCH)
        constraints = [
            toppra.constraint.JointVelocityConstraint(np.column_stack((-velocity, velocity))),
            toppra.constraint.JointAccelerationConstraint(np.column_stack((-acceleration, acceleration))),
        ]
        if any(self.tool):
            speed, most = (DERATED * value if value > 0.0 else math.inf for value in self.tool)
            tool = self.first[:, joints:], self.second[:, joints:]
            constraints.append(_classes().tool(*tool, min(speed * unit, MUCH), min(most * unit**2, MUCH)))
        path = _classes().path(self.grid, self.first[:, :joints] / scale, self.second[:, :joints] / scale)
        algorithm = toppra.algorithm.TOPPRA(
            constraints, path, gridpoints=self.grid, parametrizer="ParametrizeConstAccel"
        )
        _, speeds, _ = algorithm.compute_parameterization(0.0, 0.0)
        if speeds is None or not np.isfinite(speeds).all() or (speeds[1:-1] <= 0.0).any():
            raise NoProfile(because("plan.timing.toppra", remedy("jerk_limited")))
        return np.asarray(speeds, dtype=np.float64) / unit

    def _unit(self) -> float:
        """[s] about as long as it takes: no less than speeds and accelerations alone would; raises `NoProfile`."""
        joints = len(self.limits.velocity)
        first = np.hstack((np.abs(self.first[:, :joints]), np.linalg.norm(self.first[:, joints:], axis=1)[:, None]))
        speed, most = (value if value > 0.0 else math.inf for value in self.tool)
        with np.errstate(over="ignore"):
            slowness = (first / np.append(self.limits.velocity, speed)).max(axis=1)
            rise = float((first.max(axis=0) / np.append(self.limits.acceleration, most)).max())
        lasts = max(float(np.trapezoid(slowness, self.grid)), math.sqrt(rise))
        require_short(lasts)
        return max(lasts, SHORTEST)


@cache
def load_toppra() -> Any:
    """Imported where it is needed: it takes seconds, and its sources have strings that Python warns about.

    Raises `NoProfile` where it is not installed, as on machines for which it has no wheel.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import toppra  # slow to load
            import toppra.algorithm
            import toppra.constraint
    except ImportError as error:
        raise NoProfile(because("plan.timing.no_toppra", remedy("jerk_limited"), detail=str(error))) from error

    toppra.setup_logging("ERROR")
    return toppra


@dataclass(frozen=True)
class _Classes:
    """What toppra wants to be derived from its own."""

    path: type[Any]
    tool: type[Any]


@cache
def _classes() -> _Classes:
    from toppra.constraint import DiscretizationType, LinearConstraint  # slow to load
    from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate
    from toppra.interpolator import AbstractGeometricPath

    class UnitPath(AbstractGeometricPath):  # type: ignore[misc]
        """Of length 1, known at the grid alone."""

        def __init__(self, grid: Array, first: Array, second: Array) -> None:
            self._grid, self._orders = grid, (np.zeros_like(first), first, second)

        def __call__(self, lengths: Any, order: int = 0) -> Any:
            return self._orders[order][np.searchsorted(self._grid, lengths)]

        @property
        def dof(self) -> int:
            return int(self._orders[0].shape[1])

        @property
        def path_interval(self) -> Array:
            """(2,) the first and the last length, dimensionless."""
            return self._grid[[0, -1]]

        @property
        def waypoints(self) -> None:
            return None

    class Tool(LinearConstraint):  # type: ignore[misc]
        """|p'| s' <= speed, and |p' s'' + p'' s'^2| <= most: in a polygon within the circle of what is along and
        across the path."""

        def __init__(self, first: Array, second: Array, speed: float, most: float) -> None:
            super().__init__()
            self.set_discretization_type(DiscretizationType.Interpolation)
            self.identical = True
            self._rate = np.linalg.norm(first, axis=1)
            direction = first / np.maximum(self._rate, 1e-12)[:, None]
            self._along = (second * direction).sum(axis=1)
            self._across = np.linalg.norm(second - self._along[:, None] * direction, axis=1)
            self._speed, self._most = speed, most

        def compute_constraint_params(self, path: Any, grid: Array) -> Any:
            angles = (np.arange(SIDES) + 0.5) * math.pi / SIDES
            sides = np.column_stack((np.cos(angles), np.sin(angles)))
            most = np.full(SIDES, self._most * math.cos(0.5 * math.pi / SIDES))
            a = np.column_stack((self._rate, np.zeros_like(self._rate)))
            b = np.column_stack((self._along, self._across))
            squares = np.minimum(self._speed / np.maximum(self._rate, 1e-12), MUCH) ** 2
            x = np.column_stack((np.zeros_like(squares), squares))
            *linear, x, u = canlinear_colloc_to_interpolate(a, b, 0.0 * a, sides, most, x, None, grid, identical=True)
            return (*linear, u, x)

    return _Classes(UnitPath, Tool)
