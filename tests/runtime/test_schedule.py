"""The loop's schedule: an exact grid, whatever single steps take."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.loop.loop import Schedule

RATES = st.sampled_from([1.0, 2.0, 10.0, 25.0, 50.0, 100.0, 1000.0])
DURATIONS = st.lists(st.floats(0.0, 0.2), min_size=1, max_size=50)


@given(RATES, st.floats(0.0, 1e6), DURATIONS)
def test_every_step_is_due_on_the_grid_and_after_the_one_before(
    rate: float, start: float, durations: list[float]
) -> None:
    schedule = Schedule(rate, start)
    now = start
    for duration in durations:
        now = max(now, schedule.deadline)
        begun = schedule.deadline
        schedule.begin(now)
        now += duration
        schedule.end(now)
        slot = (schedule.deadline - start) * rate
        assert slot == pytest.approx(round(slot), abs=1e-3)
        assert schedule.deadline > begun
        assert now < schedule.deadline + 1e-6
        assert schedule.deadline <= max(now, begun) + 1.0 / rate + 1e-6


def test_a_million_short_steps_do_not_drift() -> None:
    schedule = Schedule(50.0, 0.0)
    for _ in range(1_000_000):
        schedule.begin(schedule.deadline)
        schedule.end(schedule.deadline)
    assert schedule.deadline == 20_000.0


def test_lateness_is_the_worst_since_the_last_report() -> None:
    schedule = Schedule(10.0, 0.0)
    for late in (0.01, 0.03, 0.0):
        schedule.begin(schedule.deadline + late)
        schedule.end(schedule.deadline)
    figures = schedule.take_figures()
    assert (figures.steps, figures.late_max) == (3, pytest.approx(0.03))
    assert schedule.take_figures().steps == 0


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_rate_must_be_above_zero(rate: float) -> None:
    with pytest.raises(ValueError, match="above 0"):
        Schedule(rate, 0.0)
