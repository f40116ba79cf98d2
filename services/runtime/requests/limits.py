"""The limits of what the clients of one node may ask for: per second, and waiting at a time."""

from __future__ import annotations

import threading
import time
from collections import Counter

from services.runtime.bus.pace import Rate, TokenBucket

# Chosen. A panel and its programs ask some ten times a second; a script that only asks goes by its pace (bus/pace.py),
# which stays below. A request that is dropped costs its server some 20 us, one that is answered 300.
# The burst is what a flood gets before nothing of it is taken, and a plan costs more than its request: of 1,000 plans a
# second 1,100 were made (1.1 s of processor time, beside any stop), with a burst of 1,000 2,000 of them (1.5 s).
OF_A_CLIENT = Rate(500.0, 550)  # requests to one node, and as many urgent ones; those above it are dropped unread
DEBT = 500  # requests above it that count as well: a flood is not carried out in part, which would cost far more
OF_REFUSALS = Rate(100.0, 1000)  # answers "busy" of one node; the other refusals are dropped without an answer
MAX_CLIENTS = 256  # whose rates are kept; those that come on top of them share one

# Chosen: a script waits for its answers, so few clients ever have more than one request here.
MAX_WAITING_OF_A_CLIENT = 64  # requests of one client that wait in one server; more are refused
MAX_WAITING = 1024  # requests of all clients that wait in one server; more are refused


class RequestRates:
    """The rates of one node, over all keys that it serves; from any thread."""

    def __init__(self, of_a_client: Rate = OF_A_CLIENT, of_refusals: Rate = OF_REFUSALS) -> None:
        now = time.monotonic()
        self._of_a_client = of_a_client
        self._refusals = TokenBucket(of_refusals, now)
        self._others = TokenBucket(of_a_client, now)  # of the clients that have no bucket of their own
        self._of: dict[tuple[str, bool], TokenBucket] = {}  # by client, and whether of its urgent requests
        self._lock = threading.Lock()

    def permit_request(self, client: str, urgent: bool = False) -> bool:
        """True if `client` may ask once more now; its urgent requests are counted for themselves."""
        now, kind = time.monotonic(), (client, urgent)
        with self._lock:
            bucket = self._of.get(kind) or self._new(kind, now)
            return bucket.take(now)

    def permit_refusal(self) -> bool:
        """True if one more request may be answered with why it is not carried out."""
        with self._lock:
            return self._refusals.take(time.monotonic())

    def _new(self, kind: tuple[str, bool], now: float) -> TokenBucket:
        if len(self._of) >= MAX_CLIENTS:
            self._of = {each: bucket for each, bucket in self._of.items() if not bucket.is_full(now)}
        if len(self._of) >= MAX_CLIENTS:
            return self._others
        return self._of.setdefault(kind, TokenBucket(self._of_a_client, now, DEBT))


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
