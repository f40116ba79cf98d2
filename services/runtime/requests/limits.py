"""The limits of what the clients of one node may ask for: per second, and waiting at a time."""

from __future__ import annotations

import threading
import time
from collections import Counter
from typing import NamedTuple


class Rate(NamedTuple):
    """So many at once, and so many a second from then on."""

    per_second: float  # [1/s]
    burst: int


# Chosen. A script waits for its answers, so its rate is one by the round trip, some hundred a second; a panel and its
# programs ask some ten times a second. A request that is dropped costs its server some 20 us, one that is answered 300.
OF_A_CLIENT = Rate(500.0, 1000)  # requests to one node; those above it are dropped without an answer
OF_REFUSALS = Rate(100.0, 1000)  # answers "busy" of one node; the other refusals are dropped without an answer
MAX_CLIENTS = 256  # whose rates are kept; those that come on top of them share one

# Chosen: a script waits for its answers, so few clients ever have more than one request here.
MAX_WAITING_OF_A_CLIENT = 64  # requests of one client that wait in one server; more are refused
MAX_WAITING = 1024  # requests of all clients that wait in one server; more are refused


class TokenBucket:
    """Permits what a rate permits, from a full bucket on."""

    def __init__(self, rate: Rate, now: float) -> None:
        """`now` in [s] monotonic."""
        self._rate = rate
        self._tokens, self._at = float(rate.burst), now

    def take(self, now: float) -> bool:
        """True if one more is permitted at `now` [s] monotonic."""
        self._refill(now)
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def is_full(self, now: float) -> bool:
        """True if until `now` [s] nothing was taken for long enough that the bucket is as good as new."""
        self._refill(now)
        return self._tokens >= self._rate.burst

    def _refill(self, now: float) -> None:
        self._tokens = min(float(self._rate.burst), self._tokens + (now - self._at) * self._rate.per_second)
        self._at = now


class RequestRates:
    """The rates of one node, over all keys that it serves; from any thread."""

    def __init__(self, of_a_client: Rate = OF_A_CLIENT, of_refusals: Rate = OF_REFUSALS) -> None:
        now = time.monotonic()
        self._of_a_client = of_a_client
        self._refusals = TokenBucket(of_refusals, now)
        self._others = TokenBucket(of_a_client, now)  # of the clients that have no bucket of their own
        self._of: dict[str, TokenBucket] = {}
        self._lock = threading.Lock()

    def permit_request(self, client: str) -> bool:
        """True if `client` may ask once more now."""
        now = time.monotonic()
        with self._lock:
            bucket = self._of.get(client) or self._new(client, now)
            return bucket.take(now)

    def permit_refusal(self) -> bool:
        """True if one more request may be answered with why it is not carried out."""
        with self._lock:
            return self._refusals.take(time.monotonic())

    def _new(self, client: str, now: float) -> TokenBucket:
        if len(self._of) >= MAX_CLIENTS:
            self._of = {name: bucket for name, bucket in self._of.items() if not bucket.is_full(now)}
        if len(self._of) >= MAX_CLIENTS:
            return self._others
        return self._of.setdefault(client, TokenBucket(self._of_a_client, now))


class WaitingRequests:
    """Counts the waiting requests per client and limits them, so that one client cannot block the others."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._of: Counter[str] = Counter()
        self._lock = threading.Lock()

    def refusal(self, client: str) -> str:
        """Counts one more request of `client`; returns the reason if its limit is reached, else an empty text."""
        with self._lock:
            if self._of[client] >= MAX_WAITING_OF_A_CLIENT:
                return f"{self._key}: {MAX_WAITING_OF_A_CLIENT} requests are waiting already, all of this client"
            if self._of.total() >= MAX_WAITING:
                return f"{self._key}: {MAX_WAITING} requests are waiting already"
            self._of[client] += 1
            return ""

    def leave(self, client: str) -> None:
        with self._lock:
            self._of[client] -= 1
            if self._of[client] <= 0:
                del self._of[client]
