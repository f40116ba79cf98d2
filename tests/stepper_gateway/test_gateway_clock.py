"""The device's clock: found through jitter, drift and sleep, and never believed beyond what the exchanges allow."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.services.stepper_gateway.device.clock import ClockSync

OFFSET = 7_000_000.0  # [us]


def true_time(ours: float, drift: float = 0.0) -> float:
    return ours * (1.0 + drift) + OFFSET


def exchange(clock: ClockSync, now: float, there: float, back: float, drift: float = 0.0, offset: float = 0.0) -> None:
    heard = round(true_time(now + there, drift) + offset)
    clock.add(round(now), heard, heard, round(now + there + back))


@given(st.integers(0, 2**32), st.floats(-1e-4, 1e-4), st.floats(100.0, 20_000.0))
def test_the_error_is_never_more_than_half_the_shortest_round_trip_and_the_drift(
    seed: int, drift: float, jitter: float
) -> None:
    clock, rng, shortest = ClockSync(), random.Random(seed), 1e9
    for index in range(20):
        there, back = rng.uniform(200.0, jitter + 200.0), rng.uniform(200.0, jitter + 200.0)
        shortest = min(shortest, there + back)
        exchange(clock, index * 5e5, there, back, drift)
    now = 20 * 5e5
    assert abs(clock.device_time(now * 1e-6) - true_time(now, drift)) <= jitter + 20 * 5e5 * 3e-4


@pytest.mark.parametrize("drift", [100e-6, -100e-6, 0.0])
def test_a_drift_is_learnt(drift: float) -> None:
    clock, rng = ClockSync(), random.Random(1)
    for index in range(64):
        exchange(clock, index * 5e5, rng.uniform(500, 700), rng.uniform(500, 700), drift)
    later = 64 * 5e5 + 10e6  # a link that is away for ten seconds
    assert abs(clock.device_time(later * 1e-6) - true_time(later, drift)) < 100.0


def test_a_late_answer_moves_nothing() -> None:
    clock = ClockSync()
    for index in range(12):
        exchange(clock, index * 5e5, 1000.0, 1000.0)
    before = clock.device_time(6.0)
    exchange(clock, 6e6, 1000.0, 400_000.0)
    assert abs(clock.device_time(6.0) - before) <= 5


@given(st.floats(-2e-4, 2e-4), st.floats(0.0, 1e5))
def test_there_and_back_is_the_same_instant(drift: float, instant: float) -> None:
    clock = ClockSync()
    for index in range(64):
        exchange(clock, index * 5e5, 800.0, 800.0, drift)
    assert clock.monotonic(clock.device_time(instant)) == pytest.approx(instant, abs=2e-6)


def test_a_machine_that_has_slept_begins_anew() -> None:
    clock = ClockSync()
    for index in range(20):
        exchange(clock, index * 5e5, 1000.0, 1000.0)
    assert clock.is_synchronised
    assert not clock.is_contradicted
    slept = 60e6  # our monotonic clock stood still meanwhile
    exchange(clock, 20 * 5e5, 1000.0, 1000.0, offset=slept)
    assert clock.is_contradicted
    for index in range(21, 24):
        exchange(clock, index * 5e5, 1000.0, 1000.0, offset=slept)
    assert abs(clock.device_time(12.0) - true_time(12e6) - slept) <= 2


def test_an_impossible_exchange_is_passed_over() -> None:
    clock = ClockSync()
    clock.add(1000, 50, 40, 2000)
    clock.add(2000, 50, 60, 1000)
    assert clock.exchanges == 0


@pytest.mark.parametrize("drift", [500e-6, -500e-6, 2000e-6])
def test_a_quartz_beyond_its_data_sheet_is_followed_without_a_gap(drift: float) -> None:
    clock, rng = ClockSync(), random.Random(1)
    for index in range(240):
        ours = index * 5e5
        exchange(clock, ours, rng.uniform(300, 2000), rng.uniform(300, 2000), drift)
        assert clock.is_synchronised or index < 3, index
        if index > 3:
            assert abs(clock.device_time(ours * 1e-6) - true_time(ours, drift)) < 6000.0
