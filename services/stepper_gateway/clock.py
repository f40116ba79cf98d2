"""The device's clock as seen from here, by the exchange with the shortest round trip (as NTP does)."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

WINDOW = 12  # exchanges, 6 s at 2 Hz: a drift of 50 ppm moves the offset by 0.3 ms
DRIFT = 5_000.0  # [us] that two clocks may part within the window, generously
ENOUGH = 3  # exchanges until the offset is trusted


class Exchange(NamedTuple):
    """One SYNC and its reply."""

    offset: float  # [us] device clock minus our monotonic clock
    round_trip: float  # [us] without the device's own thinking time


class ClockSync:
    """Maps between our monotonic clock and the microseconds since the device's boot."""

    def __init__(self) -> None:
        self._exchanges: deque[Exchange] = deque(maxlen=WINDOW)
        self._offset = 0.0

    def reset(self) -> None:
        """Forget everything: another boot is another clock."""
        self._exchanges.clear()

    def add(self, t0: int, t1: int, t2: int, t3: int) -> None:
        """t0 sent and t3 received on our clock, t1 received and t2 sent on the device's [us]."""
        round_trip = (t3 - t0) - (t2 - t1)
        if round_trip < 0 or t2 < t1:
            return
        exchange = Exchange(((t1 - t0) + (t2 - t3)) / 2.0, round_trip)
        if self._exchanges and not _agree(exchange, min(self._exchanges, key=lambda one: one.round_trip)):
            self._exchanges.clear()
        self._exchanges.append(exchange)
        self._offset = min(self._exchanges, key=lambda exchange: exchange.round_trip).offset

    @property
    def exchanges(self) -> int:
        return len(self._exchanges)

    @property
    def is_synchronised(self) -> bool:
        return len(self._exchanges) >= ENOUGH

    @property
    def round_trip(self) -> float:
        """[s] of the latest exchange."""
        return self._exchanges[-1].round_trip * 1e-6 if self._exchanges else 0.0

    def device_time(self, monotonic: float) -> int:
        """[us] of the device's clock at an instant of ours [s]."""
        return max(0, round(monotonic * 1e6 + self._offset))

    def monotonic(self, device_us: int) -> float:
        """[s] of our monotonic clock at an instant of the device's [us]."""
        return (device_us - self._offset) * 1e-6


def _agree(first: Exchange, second: Exchange) -> bool:
    """Whether one offset can explain both: each is wrong by half its round trip at most.

    It cannot when this machine has slept meanwhile, as its monotonic clock stands still then.
    """
    return abs(first.offset - second.offset) <= (first.round_trip + second.round_trip) / 2.0 + DRIFT
