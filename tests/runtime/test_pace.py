"""The pace of a client's own requests: a server takes all of it, and takes nothing of a flood."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.bus.pace import OF_ALL_REQUESTS, Pace, Rate, TokenBucket
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.requests.limits import DEBT, OF_A_CLIENT
from tests.runtime.support import RouterProcess, until

HELD_UP = 1.0  # [s] that a request may take on its way


class Clock:
    """Virtual time [s], which passes while somebody sleeps."""

    def __init__(self) -> None:
        self.now = 0.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def pace(self, rate: Rate = OF_ALL_REQUESTS) -> Pace:
        return Pace(rate, lambda: self.now, self.sleep)


def server() -> TokenBucket:
    return TokenBucket(OF_A_CLIENT, 0.0, DEBT)


@given(
    st.lists(st.tuples(st.floats(0.0, 2.0), st.integers(1, 600)), min_size=1, max_size=8),
    st.lists(st.floats(0.0, HELD_UP), min_size=1, max_size=20),
)
def test_a_server_takes_all_that_a_client_asks_at_its_pace(
    bursts: list[tuple[float, int]], delays: list[float]
) -> None:
    """However it asks, and however long each request is under way."""
    clock, arrivals = Clock(), list[float]()
    pace = clock.pace()
    for pause, count in bursts:
        clock.sleep(pause)
        for _ in range(count):
            pace.wait_for_turn()
            arrivals.append(clock.now + delays[len(arrivals) % len(delays)])
    bucket = server()
    assert all(bucket.take(at) for at in sorted(arrivals))


@given(st.integers(0, 3000))
def test_a_loop_is_slowed_down_to_the_rate(count: int) -> None:
    clock = Clock()
    pace = clock.pace()
    for _ in range(count):
        pace.wait_for_turn()
    assert clock.now == pytest.approx(max(0, count - OF_ALL_REQUESTS.burst) / OF_ALL_REQUESTS.per_second)


@given(st.floats(1.1, 20.0), st.floats(1.0, 5.0))
def test_of_a_flood_no_more_than_the_burst_is_taken(factor: float, seconds: float) -> None:
    bucket, rate = server(), OF_A_CLIENT.per_second * factor
    last = [number for number in range(round(seconds * rate)) if bucket.take(number / rate)][-1]
    assert last < OF_A_CLIENT.burst / (1 - 1 / factor) + 1


@given(st.floats(1.5, 20.0), st.floats(0.01, 1.0))
def test_after_a_flood_a_client_is_served_again(factor: float, share: float) -> None:
    bucket, rate = server(), OF_A_CLIENT.per_second * factor
    count = round(5.0 * rate)
    for number in range(count):
        bucket.take(number / rate)
    began = count / rate + (DEBT + 1) / OF_A_CLIENT.per_second
    assert all(bucket.take(began + number / (share * OF_A_CLIENT.per_second)) for number in range(1000))


def test_without_debt_a_rate_is_taken_of_a_flood() -> None:
    bucket = TokenBucket(Rate(100.0, 10), 0.0)
    assert sum(bucket.take(number / 1000.0) for number in range(1000)) == pytest.approx(110, abs=2)


def test_all_but_stops_wait_for_their_turn(router: RouterProcess, request: pytest.FixtureRequest) -> None:
    clock = Clock()
    bus = ZenohBus(router.deployment.router, "rm1", clock.pace(Rate(10.0, 5)))
    request.addfinalizer(bus.close)
    ends: list[object] = []
    for _ in range(50):
        bus.ask("device/stop", "Question", b"", 30.0, ends.append, True)
    assert clock.now == 0.0
    for _ in range(25):
        bus.ask("plan", "Question", b"", 30.0, ends.append)
    assert clock.now == pytest.approx(2.0)
    assert until(lambda: len(ends) == 75)
