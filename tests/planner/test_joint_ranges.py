"""Full turns within the limits, and the order of configurations, are the same compiled and in Python."""

from __future__ import annotations

import math

import numpy as np

from gemelo.services.planner.kinematics import joint_ranges
from gemelo.services.planner.kinematics.joint_ranges import MOST_TURNS
from tests.table import table


@table("seed", range(20))
def test_compiled_and_in_python_the_turns_are_the_same_to_the_bit(seed: int) -> None:
    random = np.random.default_rng(seed)
    branches = random.uniform(-math.pi, math.pi, (8, 6))
    branches[2, 3] = np.nan
    lower, upper = random.uniform(-8.0, -1.0, 6), random.uniform(1.0, 8.0, 6)
    period = np.full(6, math.tau)
    lower[5], upper[5], period[5] = -0.2, 0.3, joint_ranges.NEVER
    compiled = joint_ranges.turned(branches, lower, upper, period)
    assert np.array_equal(compiled, joint_ranges.turned_in_python(branches, lower, upper, period))
    assert (compiled >= lower).all()
    assert (compiled <= upper).all()


def test_compiled_and_in_python_where_there_are_many_turns_the_same_ones_are_left() -> None:
    branches, far, period = np.zeros((1, 4)), np.array([60.0, 60.0, 7.0, 1.0]), np.full(4, math.tau)
    compiled = joint_ranges.turned(branches, -far, far, period)
    assert np.array_equal(compiled, joint_ranges.turned_in_python(branches, -far, far, period))
    assert 1 < len(compiled) <= MOST_TURNS


def test_compiled_and_in_python_there_is_nothing_beyond_the_limits() -> None:
    branches, period = np.array([[0.0, 1.0]]), np.full(2, math.tau)
    lower, upper = np.array([-1.0, 1.5]), np.array([1.0, 2.0])
    for turned in (joint_ranges.turned, joint_ranges.turned_in_python):
        assert turned(branches, lower, upper, period).shape == (0, 2)


def test_compiled_and_in_python_the_nearest_are_first_and_equals_stay_in_order() -> None:
    random = np.random.default_rng(1)
    rows, near, speed = random.uniform(-3.0, 3.0, (40, 6)).round(1), np.zeros(6), random.uniform(1.0, 4.0, 6)
    rows[20:] = -rows[:20]
    compiled = joint_ranges.nearest_first(rows, near, speed)
    assert np.array_equal(compiled, joint_ranges.nearest_first_in_python(rows, near, speed))
