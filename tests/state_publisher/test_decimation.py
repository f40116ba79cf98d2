"""Exactly the rate asked for."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.services.state_publisher.core import Decimator

T0 = 1_700_000_000_000_000_000


def passed(rate_in: float, limit: float, duration: float) -> int:
    decimator = Decimator(limit)
    return sum(decimator.passes(T0 + round(k * 1e9 / rate_in)) for k in range(round(duration * rate_in)))


def test_25_hz_at_a_limit_of_20_gives_20_and_not_12_and_a_half():
    assert passed(25.0, 20.0, 100.0) == pytest.approx(2000, abs=1)


def test_no_limit_passes_all():
    assert passed(50.0, 0.0, 10.0) == 500


@given(st.floats(1.0, 200.0), st.floats(1.0, 200.0))
def test_out_comes_the_smaller_of_both_rates(rate_in: float, limit: float):
    assert passed(rate_in, limit, 20.0) == pytest.approx(20.0 * min(rate_in, limit), abs=2.0)


def test_a_clock_that_jumps_back_and_a_stream_that_pauses_go_on():
    decimator = Decimator(10.0)
    assert decimator.passes(T0)
    assert decimator.passes(T0 - 10**12)
    assert decimator.passes(T0 + 10**12)
    assert not decimator.passes(T0 + 10**12 + 10**7)
