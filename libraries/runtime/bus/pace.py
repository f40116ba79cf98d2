"""The pace of a client: so many requests at once, and so many a second from then on; the rest waits for its turn.

A script that asks in a loop is slowed down to it, and never asks for more than a server takes of one client.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import NamedTuple


class Rate(NamedTuple):
    """So many at once, and so many a second from then on."""

    per_second: float  # [1/s]
    burst: int


# Chosen: below what one node takes of a client (`OF_A_CLIENT` in requests/limits.py) by so much that all of it may be
# held up on its way for a second and then arrive at once.
OF_ALL_REQUESTS = Rate(450.0, 50)  # requests of one session to all nodes, but for urgent ones


class TokenBucket:
    """Permits what a rate permits, from a full bucket on.

    With `debt` what is not permitted counts as well, up to so much: who goes on asking for more than the rate gets
    nothing at all until it has asked for less, for up to `debt` / rate seconds.
    """

    def __init__(self, rate: Rate, now: float, debt: int = 0) -> None:
        """`now` in [s] monotonic."""
        self._rate, self._debt = rate, debt
        self._tokens, self._at = float(rate.burst), now

    def take(self, now: float) -> bool:
        """True if one more is permitted at `now` [s] monotonic."""
        self._refill(now)
        if self._tokens < 1.0:
            if self._debt:
                self._tokens = max(-float(self._debt), self._tokens - 1.0)
            return False
        self._tokens -= 1.0
        return True

    def reserve(self, now: float) -> float:
        """Takes one more at `now` [s] monotonic, and returns after how many [s] it is permitted."""
        self._refill(now)
        self._tokens -= 1.0
        return max(0.0, -self._tokens / self._rate.per_second)

    def is_full(self, now: float) -> bool:
        """True if until `now` [s] nothing was taken for long enough that the bucket is as good as new."""
        self._refill(now)
        return self._tokens >= self._rate.burst

    def _refill(self, now: float) -> None:
        self._tokens = min(float(self._rate.burst), self._tokens + (now - self._at) * self._rate.per_second)
        self._at = now


class Pace:
    """The turns of everything that one session asks; from any thread."""

    def __init__(
        self,
        rate: Rate = OF_ALL_REQUESTS,
        monotonic: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] = time.sleep,
    ) -> None:
        self._monotonic, self._sleep = monotonic, sleep
        self._bucket = TokenBucket(rate, monotonic())
        self._lock = threading.Lock()

    def wait_for_turn(self) -> None:
        """Returns when one more may be asked."""
        with self._lock:
            pause = self._bucket.reserve(self._monotonic())
        if pause > 0.0:
            self._sleep(pause)
