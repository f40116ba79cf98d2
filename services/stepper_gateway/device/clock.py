"""The device's clock as seen from here: offset and drift, by the exchanges whose round trips were short.

An exchange is wrong by half its round trip at most, and by little where both ways were quick. So a straight line goes
through the offsets by weighted least squares: the longer a round trip beyond the shortest, the less it weighs.

An exchange that contradicts the others is put aside, as anybody may have sent it. ENOUGH of them that agree with one
another, with none between them that agrees with the others, are the clock as it is now.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

WINDOW = 64  # exchanges, 32 s at 2 Hz; chosen: long enough for a drift to show, short enough to follow it
ENOUGH = 3  # exchanges until the offset is trusted; chosen: one may be delayed, and one be a stranger's
QUICK = 200.0  # [us] beyond the shortest round trip: such an exchange weighs a quarter; chosen: a network's jitter
SPAN = 5e6  # [us] that the exchanges must cover until they tell of a drift; chosen: less drowns in the jitter
MOST_DRIFT = 2e-4  # of a clock; chosen: twice what a crystal's data sheet allows
STEADY = 1000.0  # [us] that two clocks may part beyond any drift; chosen: a slot of the device, which stamps by slots


class SyncExchange(NamedTuple):
    """One SYNC and its reply."""

    asked: int  # [us] of our monotonic clock, when the SYNC was sent
    at: float  # [us] of our monotonic clock, in the middle
    offset: float  # [us] device clock minus our monotonic clock
    round_trip: float  # [us] without the device's own thinking time


class ClockLine(NamedTuple):
    """The offset as it was at `at`, and how it changes."""

    at: float  # [us]
    offset: float  # [us]
    drift: float  # [us/us]


class ClockSync:
    """Maps between our monotonic clock and the microseconds since the device's boot."""

    def __init__(self) -> None:
        self._exchanges: deque[SyncExchange] = deque(maxlen=WINDOW)
        self._contradicting: deque[SyncExchange] = deque(maxlen=WINDOW)  # since the last that agreed
        self._line = ClockLine(0.0, 0.0, 0.0)
        self.longest_round_trip = 0.0  # [s] of the exchanges that are kept, the last half minute's

    def reset(self) -> None:
        """Forget everything: another boot is another clock."""
        self._exchanges.clear()
        self._contradicting.clear()
        self.longest_round_trip = 0.0

    def add(self, t0: int, t1: int, t2: int, t3: int) -> bool:
        """True if it is believed: t0 sent, t3 received on our clock, t1 received, t2 sent on the device's [us]."""
        round_trip = (t3 - t0) - (t2 - t1)
        if round_trip < 0 or t2 < t1:
            return False
        exchange = SyncExchange(t0, (t0 + t3) / 2.0, ((t1 - t0) + (t2 - t3)) / 2.0, round_trip)
        if self._exchanges and not _agree(exchange, min(self._exchanges, key=lambda one: one.round_trip)):
            if not self._begin_anew(exchange):
                return False
        elif self.is_synchronised:
            self._contradicting.clear()
        self._exchanges.append(exchange)
        self._line = _line(self._exchanges)
        self.longest_round_trip = max(one.round_trip for one in self._exchanges) * 1e-6
        return True

    def _begin_anew(self, exchange: SyncExchange) -> bool:
        """Go on with what agrees with `exchange`, if that is enough or nothing is known yet; else put it aside."""
        known = sorted((*self._exchanges, *self._contradicting), key=lambda one: one.at)
        # A quartz that drifts beyond its data sheet contradicts the old exchanges only: the young ones still tell.
        agreeing = [one for one in known if _agree(exchange, one)]
        is_enough = len({one.asked for one in (*agreeing, exchange)}) >= ENOUGH
        if self.is_synchronised and not is_enough:
            self._contradicting.append(exchange)
            return False
        others = [] if is_enough else [one for one in known if one not in agreeing]
        self._contradicting = deque(others, maxlen=WINDOW)
        self._exchanges = deque(agreeing, maxlen=WINDOW)
        return True

    @property
    def exchanges(self) -> int:
        return len(self._exchanges)

    @property
    def is_synchronised(self) -> bool:
        return len(self._exchanges) >= ENOUGH

    @property
    def is_contradicted(self) -> bool:
        """True if the last exchange does not fit to those before."""
        return self.is_synchronised and bool(self._contradicting)

    @property
    def round_trip(self) -> float:
        """[s] of the latest exchange."""
        return self._exchanges[-1].round_trip * 1e-6 if self._exchanges else 0.0

    def device_time(self, monotonic: float) -> int:
        """[us] of the device's clock at an instant of ours [s]."""
        at, offset, drift = self._line
        ours = monotonic * 1e6
        return max(0, round(ours + offset + drift * (ours - at)))

    def monotonic(self, device_us: int) -> float:
        """[s] of our monotonic clock at an instant of the device's [us]."""
        at, offset, drift = self._line
        return (device_us - offset + drift * at) / (1.0 + drift) * 1e-6

    def measured(self, device_us: int, arrival: float) -> float:
        """[s] of our monotonic clock when the device measured what arrived then; the arrival, if no clock tells."""
        return min(self.monotonic(device_us), arrival) if self.is_synchronised else arrival


def _line(exchanges: deque[SyncExchange]) -> ClockLine:
    shortest = min(exchange.round_trip for exchange in exchanges)
    weights = [(1.0 + (exchange.round_trip - shortest) / QUICK) ** -2 for exchange in exchanges]
    total = sum(weights)
    at = sum(w * exchange.at for w, exchange in zip(weights, exchanges, strict=True)) / total
    offset = sum(w * exchange.offset for w, exchange in zip(weights, exchanges, strict=True)) / total
    return ClockLine(at, offset, _drift(exchanges, weights, at, offset))


def _drift(exchanges: deque[SyncExchange], weights: list[float], at: float, offset: float) -> float:
    if exchanges[-1].at - exchanges[0].at < SPAN:
        return 0.0
    spread = product = 0.0
    for weight, exchange in zip(weights, exchanges, strict=True):
        spread += weight * (exchange.at - at) ** 2
        product += weight * (exchange.at - at) * (exchange.offset - offset)
    return max(-MOST_DRIFT, min(MOST_DRIFT, product / spread)) if spread > 0.0 else 0.0


def _agree(first: SyncExchange, second: SyncExchange) -> bool:
    """True if one clock can explain both: each is wrong by half its round trip at most.

    It cannot when this machine has slept meanwhile, as its monotonic clock stands still then.
    """
    drift = MOST_DRIFT * abs(first.at - second.at) + STEADY
    return abs(first.offset - second.offset) <= (first.round_trip + second.round_trip) / 2.0 + drift
