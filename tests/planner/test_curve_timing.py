"""Curves by their length, their timing within every limit, and whole ways against everything around."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruckig import InputParameter, Result, Ruckig, Trajectory

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.path.curve import smooth_runs
from gemelo.services.planner.path.smoothing import smooth, stopping
from gemelo.services.planner.request.deadline import NEVER
from gemelo.services.planner.timing import profile
from gemelo.services.planner.timing.profile import joint_limits, trajectory_of
from gemelo.services.planner.timing.time_optimal import time_optimal_path
from gemelo.services.planner.timing.timing import timed_path, timed_path_in_python
from gemelo.services.planner.verification.verify import limit_shares, require_ends, sample
from gemelo.tools.bench.scenes import SCENES
from tests.profiles import examples

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "parol6")
LOWER = np.array([joint.lower for joint in ARM.joints])
UPPER = np.array([joint.upper for joint in ARM.joints])
LIMITS = joint_limits(ARM)


class Everywhere:
    """Nothing stands anywhere."""

    def is_free(self, configuration: np.ndarray) -> bool:
        return True

    def is_line_free(self, start: np.ndarray, goal: np.ndarray) -> bool:
        return True

    def is_curve_free(self, control: np.ndarray) -> bool:
        return True


def corners_of(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.8 * LOWER, 0.8 * UPPER, (count, len(LOWER)))


@examples(quick=8, full=25)
@given(st.integers(0, 10_000), st.integers(2, 5), st.floats(0.05, 1.0), st.floats(0.05, 1.0))
def test_a_timed_curve_keeps_every_limit_and_its_ends(seed: int, count: int, speed: float, acceleration: float):
    corners, limits = corners_of(seed, count), joint_limits(ARM, speed, acceleration)
    trajectory = trajectory_of(ARM.joint_names, timed_path(smooth(corners, Everywhere(), NEVER), limits))
    require_ends(trajectory, tuple(corners[0].tolist()), tuple(corners[-1].tolist()))
    velocity, accelerations, jerk = limit_shares(sample(trajectory, 100), limits)
    assert max(velocity, accelerations) <= 1.0
    assert jerk <= 1.01


def test_a_curve_is_measured_by_its_length_with_its_derivatives():
    for run in smooth_runs(smooth(corners_of(3, 4), Everywhere(), NEVER), LIMITS.velocity):
        lengths = np.linspace(0.0, run.length, 3001)
        way, step = run.at(lengths), run.length / 3000
        assert np.allclose(np.linalg.norm(way.first, axis=1), 1.0, atol=1e-9)
        assert np.allclose(np.gradient(way.value, step, axis=0)[2:-2], way.first[2:-2], atol=1e-4)
        assert np.median(np.abs(np.gradient(way.first, step, axis=0) - way.second)[2:-2]) < 1e-3
        assert np.median(np.abs(np.gradient(way.second, step, axis=0) - way.third)[2:-2]) < 1e-2


def test_a_way_that_cannot_be_rounded_stops_at_every_corner():
    corners = corners_of(5, 4)
    trajectory = trajectory_of(ARM.joint_names, timed_path(stopping(corners), LIMITS))
    rows = np.array([point.positions for point in trajectory.points])
    speeds = np.array([point.velocities for point in trajectory.points])
    for corner in corners:
        nearest = int(np.abs(rows - corner).max(axis=1).argmin())
        assert rows[nearest] == pytest.approx(corner, abs=1e-9)
        assert np.abs(speeds[nearest]).max() < 1e-6
    assert limit_shares(sample(trajectory, 100), LIMITS)[2] <= 1.01


def test_a_jerk_limited_way_takes_at_most_three_times_the_time_optimal_one():
    for seed in range(4):
        control = smooth(corners_of(seed, 3), Everywhere(), NEVER)
        made = (make(control, LIMITS) for make in (timed_path, time_optimal_path))
        limited, optimal = (trajectory_of(ARM.joint_names, states) for states in made)
        velocity, acceleration, _ = limit_shares(sample(optimal, 100), LIMITS)
        assert max(velocity, acceleration) <= 1.0
        assert limited.points[-1].time_from_start <= 3.0 * optimal.points[-1].time_from_start


def test_what_ruckig_is_asked_about_a_curve_has_no_waypoints(monkeypatch: pytest.MonkeyPatch):
    asked: list[InputParameter] = []

    class Listening(Ruckig):
        def calculate(self, demand: InputParameter, trajectory: Trajectory) -> Result:
            asked.append(demand)
            return super().calculate(demand, trajectory)

    monkeypatch.setattr(profile, "Ruckig", Listening)
    timed_path_in_python(smooth(corners_of(1, 4), Everywhere(), NEVER), LIMITS)
    assert asked
    assert all(demand.intermediate_positions == [] for demand in asked)


@pytest.mark.parametrize("name", ["rm1", "parol6"])
@pytest.mark.parametrize("scene", ["shelf", "cage"])
def test_a_way_that_is_called_free_is_free_wherever_it_is_looked_at(name: str, scene: str):
    arm = load_arm(ARM.folder.parent / name)
    world = World(arm, Kinematics(arm), SCENES[scene])
    random = np.random.default_rng(9)
    low, high = (np.clip([getattr(joint, side) for joint in arm.joints], -3.1, 3.1) for side in ("lower", "upper"))
    verdicts = set()
    for _ in range(12):
        ends = random.uniform(low, high, (2, len(low)))
        touching = world.touching(ends, 0.004)
        verdicts.add(touching is None)
        if touching is not None:
            assert world.distance(touching) <= 0.004
        else:
            rows = ends[0] + np.linspace(0.0, 1.0, 150)[:, None] * (ends[1] - ends[0])
            assert min(world.distance(row) for row in rows) > 0.003 - 1e-9
    assert False in verdicts
