"""Timing: within limits at ten times the samples, straight, exact at both ends, and nothing leaves the machine."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruckig import InputParameter, Result, Ruckig, Trajectory

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.motion import JointTrajectory
from gemelo.services.planner.timing import profile
from gemelo.services.planner.timing.profile import joint_limits, straight_line
from gemelo.services.planner.verification.verify import require_ends, require_within_limits, sample
from tests.profiles import examples

ARM = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
CONFIGURATIONS = st.tuples(*[st.floats(joint.lower, joint.upper) for joint in ARM.joints])
SCALINGS = st.floats(0.01, 1.0)


def dense(trajectory: JointTrajectory, parts: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ten times as fine as the points, by the sampler that the gateway uses."""
    times = [point.time_from_start for point in trajectory.points]
    grid = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in itertools.pairwise(times)]))
    sampler = TrajectorySampler(trajectory)
    rows = [sampler.at(float(t)) for t in grid]
    return (grid, *(np.array([row[i] for row in rows]) for i in range(3)))


@examples(full=200)
@given(CONFIGURATIONS, CONFIGURATIONS, SCALINGS, SCALINGS)
def test_a_trajectory_never_exceeds_joint_limits(
    start: tuple[float, ...], goal: tuple[float, ...], speed: float, acceleration: float
):
    limits = joint_limits(ARM, speed, acceleration)
    trajectory = straight_line(ARM.joint_names, start, goal, limits)
    _, p, v, a = dense(trajectory)
    assert (np.abs(v) <= limits.velocity * (1 + 1e-9)).all()
    assert (np.abs(a) <= limits.acceleration * (1 + 1e-9)).all()
    for column, joint in enumerate(ARM.joints):
        assert p[:, column].min() >= joint.lower - 1e-9
        assert p[:, column].max() <= joint.upper + 1e-9
    require_within_limits(ARM, sample(trajectory), limits)


@examples(quick=30)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_start_and_end_are_exact_and_at_rest(start: tuple[float, ...], goal: tuple[float, ...]):
    trajectory = straight_line(ARM.joint_names, start, goal, joint_limits(ARM))
    require_ends(trajectory, start, goal)
    times = [point.time_from_start for point in trajectory.points]
    assert times[0] == 0.0
    assert all(b - a > 0.5e-4 for a, b in itertools.pairwise(times))


@examples(quick=30)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_the_joints_move_on_a_straight_line_and_never_back(start: tuple[float, ...], goal: tuple[float, ...]):
    _, p, _, _ = dense(straight_line(ARM.joint_names, start, goal, joint_limits(ARM)))
    way = np.subtract(goal, start)
    share = (p - start) @ way / max(float(way @ way), 1e-300)
    assert np.allclose(p, np.add(start, np.outer(share, way)), atol=1e-9)
    assert (np.diff(share) >= -1e-9).all()


@examples(quick=20, full=50)
@given(CONFIGURATIONS, CONFIGURATIONS)
def test_jerk_is_limited_and_the_acceleration_has_no_jump(start: tuple[float, ...], goal: tuple[float, ...]):
    limits = joint_limits(ARM)
    t, _, _, a = dense(straight_line(ARM.joint_names, start, goal, limits))
    wide = np.diff(t) > 1e-3
    assert (np.abs(np.diff(a, axis=0))[wide] / np.diff(t)[wide, None] <= 1.01 * limits.jerk + 1e-6).all()


@given(st.floats(0.0, 1.0), st.integers(-14, -2))
def test_the_shortest_ways_are_timed_too(share: float, exponent: int):
    start = (0.1, -0.2, 0.05)
    goal = tuple(value + share * 10.0**exponent for value in start)
    limits = joint_limits(ARM)
    trajectory = straight_line(ARM.joint_names, start, goal, limits)
    require_ends(trajectory, start, goal)
    require_within_limits(ARM, sample(trajectory), limits)


def test_the_slowest_joint_is_at_its_limit():
    _, _, v, _ = dense(straight_line(ARM.joint_names, (0.0, 0.0, 0.0), (0.1, 0.1, 0.2), joint_limits(ARM)))
    assert np.abs(v[:, 2]).max() == pytest.approx(ARM.joints[2].velocity, rel=0.01)


def test_points_are_at_most_50_ms_apart_but_few_on_a_long_way():
    trajectory = straight_line(ARM.joint_names, (0.0, 0.0, 0.0), (1.0, 0.0, 0.1), joint_limits(ARM))
    times = [point.time_from_start for point in trajectory.points]
    assert max(b - a for a, b in itertools.pairwise(times)) <= 0.076
    slow = straight_line(ARM.joint_names, (0.0, 0.0, 0.0), (1.0, 0.0, 0.1), joint_limits(ARM, 1e-4, 1e-4))
    assert len(slow.points) < 500


def test_no_code_sends_a_trajectory_to_ruckigs_cloud():
    """`intermediate_positions` and the waypoint calculators of ruckig's community version ask a server."""
    root = Path(__file__).parents[2]
    folders = ("services", "libraries", "tools", "schemas", "gemelo", "firmware", "examples")
    sources = [path for folder in folders for path in (root / folder).rglob("*.py")]
    assert len(sources) > 20
    forbidden = re.compile(r"intermediate_positions|per_section_|max_number_of_waypoints|cloud_client")
    assert [path.name for path in sources if forbidden.search(path.read_text(encoding="utf-8"))] == []


def test_what_ruckig_is_asked_has_no_waypoints(monkeypatch: pytest.MonkeyPatch):
    """Seen from the call: one variable, from rest to rest, which ruckig computes on this machine."""
    asked: list[InputParameter] = []

    class Listening(Ruckig):
        def calculate(self, demand: InputParameter, trajectory: Trajectory) -> Result:
            asked.append(demand)
            return super().calculate(demand, trajectory)

    monkeypatch.setattr(profile, "Ruckig", Listening)
    monkeypatch.setattr(profile, "stop_and_go", profile.stop_and_go_in_python)  # the compiled core does without ruckig
    straight_line(ARM.joint_names, (0.0, 0.0, 0.0), (1.0, -0.5, 0.1), joint_limits(ARM))
    assert [demand.intermediate_positions for demand in asked] == [[]]
