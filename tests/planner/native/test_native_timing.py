"""Timed by the compiled core, a path is what numpy and ruckig make of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.planner.native.compiled import IN_PYTHON
from gemelo.services.planner.path.curve import TurnsOnTheSpot
from gemelo.services.planner.path.smoothing import smooth, stopping
from gemelo.services.planner.request.deadline import NEVER
from gemelo.services.planner.timing.profile import (
    JointLimits,
    NoProfile,
    States,
    joint_limits,
    stop_and_go,
    stop_and_go_in_python,
    trajectory_of,
)
from gemelo.services.planner.timing.timing import timed_path, timed_path_in_python
from gemelo.services.planner.verification.verify import at_times
from tests.optional import need
from tests.profiles import examples

ARM = load_arm(Path(__file__).parents[3] / "urdf" / "parol6")
LOWER, UPPER = np.array([(joint.lower, joint.upper) for joint in ARM.joints]).T
LIMITS = joint_limits(ARM)
SCALINGS = st.floats(0.01, 1.0)


@pytest.fixture(scope="module", autouse=True)
def built() -> None:
    """Without Python's headers the core is not built; with them it is."""
    if IN_PYTHON:
        need("headers")


class HalfFree:
    """Refuses about half of the curves: where corners are rounded, how far, and where not at all, is mixed."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def is_free(self, configuration: np.ndarray) -> bool:
        return True

    def is_line_free(self, start: np.ndarray, goal: np.ndarray) -> bool:
        return True

    def is_curve_free(self, control: np.ndarray) -> bool:
        return bool(self._random.random() < 0.5)


def corners_of(seed: int, count: int, size: float) -> np.ndarray:
    rows = np.random.default_rng(seed).uniform(0.9 * LOWER, 0.9 * UPPER, (count, len(LOWER)))
    return rows[:1] + size * (rows - rows[:1])


def values_at(states: States, shares: np.ndarray) -> np.ndarray:
    trajectory = trajectory_of(ARM.joint_names, states)
    return at_times(trajectory, shares * trajectory.points[-1].time_from_start).positions


@given(st.integers(0, 10_000), st.integers(2, 6), st.sampled_from((1.0, 0.03, 1e-4, 0.0)), SCALINGS, SCALINGS)
def test_lines_with_stops_are_the_same_to_rounding(
    seed: int, count: int, size: float, speed: float, acceleration: float
):
    corners, limits = corners_of(seed, count, size), joint_limits(ARM, speed, acceleration)
    for compiled, python in zip(stop_and_go(corners, limits), stop_and_go_in_python(corners, limits), strict=True):
        assert compiled.shape == python.shape
        assert np.abs(compiled - python).max() <= 1e-11 * max(1.0, float(np.abs(python).max()))


@examples(quick=20, full=60)
@given(st.integers(0, 10_000), st.integers(2, 6), st.sampled_from((1.0, 0.03)), SCALINGS, SCALINGS)
def test_curves_take_the_same_time_and_are_at_the_same_place_at_every_moment(
    seed: int, count: int, size: float, speed: float, acceleration: float
):
    """Not to the bit: ruckig's own rounding of 1e-9 decides where a phase that is next to nothing has its point."""
    limits = joint_limits(ARM, speed, acceleration)
    control = smooth(corners_of(seed, count, size), HalfFree(seed), NEVER)
    compiled, python = timed_path(control, limits), timed_path_in_python(control, limits)
    assert compiled.times[-1] == pytest.approx(python.times[-1], rel=2e-4)
    shares = np.linspace(0.0, 1.0, 501)
    apart = np.abs(values_at(compiled, shares) - values_at(python, shares)) / LIMITS.velocity
    assert apart.max() <= 2e-4 * max(1.0, float(python.times[-1]))
    assert np.array_equal(compiled.positions[[0, -1]], control[[0, -1]])
    assert not compiled.velocities[[0, -1]].any()
    assert not compiled.accelerations[[0, -1]].any()


def test_a_curve_that_stops_at_every_corner_and_one_without_length_are_the_same():
    for control in (stopping(corners_of(1, 4, 1.0)), np.repeat(corners_of(2, 1, 1.0), 6, axis=0)):
        compiled, python = timed_path(control, LIMITS), timed_path_in_python(control, LIMITS)
        assert compiled.times == pytest.approx(python.times, abs=1e-6)
        assert compiled.positions == pytest.approx(python.positions, abs=1e-6)


def test_what_cannot_be_timed_is_refused_in_the_same_words():
    there = corners_of(3, 1, 1.0)
    shares = np.array([0.0, 0.0, 0.0, 0.5, 0.5 + 1e-6, 0.5 + 3e-7, 0.5 + 1.5e-6, 1.0, 1.0, 1.0])
    lingering = there + shares[:, None] * 0.3
    slow = JointLimits(1e-7 * LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk)
    for timed in (timed_path, timed_path_in_python):
        with pytest.raises(TurnsOnTheSpot, match="the curve turns on the spot"):
            timed(lingering, LIMITS)
        with pytest.raises(NoProfile, match=r"it would take more than \d.* s, 86400 s is the most"):
            timed(smooth(corners_of(4, 3, 1.0), HalfFree(0), NEVER), slow)
    for timed in (stop_and_go, stop_and_go_in_python):
        with pytest.raises(NoProfile, match=r"it would take more than \d.* s, 86400 s is the most"):
            timed(corners_of(4, 3, 1.0), slow)
