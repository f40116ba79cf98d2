"""Time laws along a path, and the peaks of the quintics between its points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.services.planner.timing.profile import JointLimits, stop_and_go, straight_line, trajectory_of
from gemelo.services.planner.timing.time_law import TimeLaw
from gemelo.services.planner.timing.timing import peak_shares
from gemelo.services.planner.verification.verify import limit_shares, sample_between

UNIT = JointLimits(np.ones(3), np.ones(3), np.ones(3))


def humped() -> TimeLaw:
    """Faster, on, slower, without a jump of the speed or the acceleration."""
    changes = ((0.5, 2.0), (0.25, 0.0), (0.5, -2.0), (1.0, 0.0), (0.5, -2.0), (0.25, 0.0), (0.5, 2.0))
    s = v = a = 0.0
    stretches = []
    for duration, jerk in changes:
        stretches.append((duration, s, v, a, jerk))
        s += duration * (v + duration * (a / 2.0 + duration * jerk / 6.0))
        v, a = v + duration * (a + duration * jerk / 2.0), a + duration * jerk
    return TimeLaw(stretches)


@given(st.integers(0, 10_000))
def test_no_sample_between_two_points_is_above_their_peaks(seed: int):
    random = np.random.default_rng(seed)
    stamps = np.cumsum(random.uniform(0.01, 0.5, 6))
    states = random.normal(size=(3, 6, 3))
    peaks = np.array(peak_shares(stamps, *states, UNIT))
    seen = np.array(limit_shares(sample_between(stamps, *states, 400), UNIT))
    assert (seen <= peaks * (1.0 + 1e-12)).all()
    assert peaks[1:] == pytest.approx(seen[1:], rel=1e-3)


def test_the_peaks_of_an_arm_at_rest_are_zero():
    still = np.full((3, 4, 3), 0.0)
    still[0] = 0.7
    assert peak_shares(np.arange(4.0), *still, UNIT) == (0.0, 0.0, 0.0)


def test_a_length_is_reached_when_the_law_says_so():
    law = humped()
    end = float(law.at(np.array([law.duration]))[0][0])
    lengths = np.linspace(0.0, end, 52)[1:-1]
    assert law.at(law.reached(lengths))[0] == pytest.approx(lengths, abs=1e-9)


def test_the_times_go_from_the_begin_to_the_end_with_every_change_of_the_jerk_and_no_wide_gap():
    law = humped()
    times = law.times(np.array([0.3]), 0.2)
    assert times[0] == 0.0
    assert times[-1] == law.duration
    assert (np.diff(times) > 0.0).all()
    assert np.diff(times).max() <= 0.2 + 1e-12
    for wanted in (0.5, 0.75, 1.25, 2.25, 2.75, 3.0, float(law.reached(np.array([0.3]))[0])):
        assert np.abs(times - wanted).min() < 1e-12


def test_a_way_with_stops_takes_as_long_as_its_legs_one_by_one_and_rests_at_every_corner():
    corners = np.random.default_rng(2).uniform(-1.0, 1.0, (5, 3)).tolist()
    whole = trajectory_of(("a", "b", "c"), stop_and_go(np.array(corners), UNIT))
    legs = [straight_line(("a", "b", "c"), start, goal, UNIT) for start, goal in pairwise(corners)]
    ends = [leg.points[-1].time_from_start for leg in legs]
    resting = [point for point in whole.points if not any(point.velocities + point.accelerations)]
    assert [point.positions for point in resting] == [tuple(corner) for corner in corners]
    assert [point.time_from_start for point in resting] == pytest.approx(np.cumsum([0.0, *ends]).tolist())
    assert len(whole.points) == sum(len(leg.points) for leg in legs) - len(legs) + 1
