"""Figures of the planned trajectories' quality: path length and duration, against the best known ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Ruckig, Trajectory

from gemelo.services.planner.timing.profile import JointLimits, joint_limits
from gemelo.services.planner.timing.toppra_speeds import load_toppra
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, rounded
from gemelo.tools.bench.planner.trials import Trial, every_trial, spread
from gemelo.tools.bench.problems.problem_sets import path_length
from gemelo.tools.bench.scenes import parol6, rm1

Array = NDArray[np.float64]

GRID = 400  # points of the path at which toppra checks the limits
SAME = 1e-4  # of a path's length: two points nearer than that count as one


def path_length_ratio() -> Figure:
    """Length of the planned paths over the shortest known ones of the same problems, where a search was needed.

    Lengths are Euclidean in times at full speed (joint values divided by velocity limits), what the searches
    minimise. `problems/known_paths.py` has found the shortest ones.
    """
    speeds = {arm.name: np.array([joint.velocity for joint in arm.joints]) for arm in (rm1(), parol6())}
    rows = [
        (length_ratio(trial, speeds[name.split()[0]]), name, index, trial.is_searched)
        for name, some in every_trial().items()
        for index, trial in enumerate(some)
        if trial.is_solved
    ]
    searched = sorted(row for row in rows if row[3])
    if not searched:
        raise NotMeasured("no path had to be searched for")
    reference: dict[str, float] = {}
    for name in every_trial():
        reference |= spread(name, [row[0] for row in searched if row[1] == name], 0.5, 0.9)
    reference |= spread("searched", [row[0] for row in searched], 0.9)
    reference |= spread("straight lines too", [row[0] for row in rows], 0.5, 0.9)
    longest, where, index, _ = searched[-1]
    note = (
        f"{len(searched)} paths that had to be searched for, of {len(rows)}; the longest is {rounded(longest)} times "
        f"as long as the best known ({where} {index}), the shortest {rounded(searched[0][0])} times"
    )
    return of_samples([row[0] for row in searched], None, reference, note)


def length_ratio(trial: Trial, speeds: Array) -> float:
    """Length of the planned path over the shortest known one, dimensionless; `speeds` (n,) [rad/s] or [m/s] are the
    velocity limits."""
    return path_length(trial.path, speeds) / trial.problem.length


def duration_ratio() -> Figure:
    """Duration of the trajectories over the time-optimal one along the same path.

    The bound of the path is toppra's, with the arm's full velocities and accelerations and no jerk limit, which the
    trajectories do keep. The joints' own bound holds for any path: the slowest joint by itself, from rest to rest
    within velocity, acceleration and jerk.
    """
    limits = {arm.name: joint_limits(arm) for arm in (rm1(), parol6())}
    solved = [
        (trial, limits[name.split()[0]]) for name, some in every_trial().items() for trial in some if trial.is_solved
    ]
    of_path = [trial.response.duration / least_time(trial.path, bounds) for trial, bounds in solved]
    of_joints = [trial.response.duration / joints_time(trial.path, bounds) for trial, bounds in solved]
    reference: dict[str, float] = {}
    for what, shares in (("the path's bound", of_path), ("the joints' own bound", of_joints)):
        for kind, is_searched in (("straight lines", False), ("searched", True)):
            some = [share for (trial, _), share in zip(solved, shares, strict=True) if trial.is_searched is is_searched]
            reference |= spread(f"{kind}, of {what}", some, 0.5, 0.9)
    note = "duration over the time-optimal one of the same path (toppra, no jerk limit); below 1 is impossible"
    return of_samples(of_path, None, reference, note)


def least_time(rows: Array, limits: JointLimits) -> float:
    """Least time [s] from rest to rest along the smooth path through `rows` (m, n), by toppra without a jerk limit."""
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
        raise NotMeasured("toppra finds no timing of a path within the limits")
    return float(np.sum(2.0 * np.diff(grid) / (speeds[1:] + speeds[:-1])))


def joints_time(rows: Array, limits: JointLimits) -> float:
    """Time [s] of the slowest joint from the first of `rows` (m, n) to the last, each joint by itself."""
    joints = rows.shape[1]
    demand, profile = InputParameter(joints), Trajectory(joints)
    demand.current_position, demand.target_position = rows[0].tolist(), rows[-1].tolist()
    demand.max_velocity, demand.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
    demand.max_jerk = limits.jerk.tolist()
    Ruckig(joints).calculate(demand, profile)
    return float(max(profile.independent_min_durations))
