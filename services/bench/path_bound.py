"""The least time along a path, by toppra: with full velocities and accelerations, and no limit of the jerk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from services.bench.figure import NotMeasured
from services.planner.timing.profile import JointLimits
from services.planner.timing.toppra_speeds import load_toppra

Array = NDArray[np.float64]

GRID = 400  # points of the path at which toppra looks at the limits
SAME = 1e-4  # of a path's length: two points nearer than that are one


def least_time(rows: Array, limits: JointLimits) -> float:
    """[s] from rest to rest along the smooth path through `rows` (m, n)."""
    toppra = load_toppra()
    steps = np.linalg.norm(np.diff(rows, axis=0) / limits.velocity, axis=1)
    kept = np.concatenate(([True], steps > SAME * steps.sum()))
    kept[-1] = True
    lengths = np.concatenate(([0.0], np.cumsum(steps)))[kept]
    path = toppra.SplineInterpolator(lengths, rows[kept])
    constraints = [
        toppra.constraint.JointVelocityConstraint(np.column_stack((-limits.velocity, limits.velocity))),
        toppra.constraint.JointAccelerationConstraint(np.column_stack((-limits.acceleration, limits.acceleration))),
    ]
    grid = np.linspace(0.0, lengths[-1], GRID)
    instance = toppra.algorithm.TOPPRA(constraints, path, gridpoints=grid, parametrizer="ParametrizeConstAccel")
    _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
    if speeds is None:
        raise NotMeasured("toppra has found no way through the limits of a path")
    return float(np.sum(2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])))
