"""How long trajectories take, against what is possible on their own path, and against any path at all.

The bound of the path is the time-optimal one, by toppra with the arm's full velocities and accelerations and without a
limit of the jerk, which the trajectories do keep. No path at all allows less than the joint that needs longest by
itself, from rest to rest within velocity, acceleration and jerk.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Ruckig, Trajectory

from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, of_samples
from services.bench.path_bound import least_time
from services.bench.plan_trials import every_trial, spread
from services.planner.timing.profile import JointLimits, joint_limits

Array = NDArray[np.float64]

UNIT = "ratio"


def measure() -> Figure:
    """Of all solved problems; the references part them, and have the other bound."""
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
    return of_samples(of_path, UNIT, None, reference, note)


def joints_time(rows: Array, limits: JointLimits) -> float:
    """[s] of the slowest joint from the first of `rows` to the last, each as fast as it can by itself."""
    joints = rows.shape[1]
    demand, profile = InputParameter(joints), Trajectory(joints)
    demand.current_position, demand.target_position = rows[0].tolist(), rows[-1].tolist()
    demand.max_velocity, demand.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
    demand.max_jerk = limits.jerk.tolist()
    Ruckig(joints).calculate(demand, profile)
    return float(max(profile.independent_min_durations))
