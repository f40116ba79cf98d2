"""A figure of a stop says how late the bench itself was."""

from __future__ import annotations

import time

import pytest

from gemelo.tools.bench import stops


class LateClock:
    """A clock on which every sleep ends 30 ms late."""

    def __init__(self) -> None:
        self._now = 100.0  # [s]

    def monotonic(self) -> float:
        return self._now

    def sleep(self, seconds: float) -> None:
        self._now += seconds + 0.03
        time.sleep(0.0)


def test_how_late_the_bench_itself_wakes_is_measured_and_no_more_than_that(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stops, "time", LateClock())
    with stops.WakeUps() as wake_ups:
        while len(wake_ups.late) < 3:
            time.sleep(0.001)
    assert wake_ups.late == pytest.approx([30.0] * len(wake_ups.late))


def test_the_measuring_ends_with_its_block() -> None:
    with stops.WakeUps() as wake_ups:
        while not wake_ups.late:
            time.sleep(0.001)
    count = len(wake_ups.late)
    time.sleep(4 * stops.SLEEP)
    assert len(wake_ups.late) == count
