"""Requests that a stop has overtaken: none that was asked for before a stop is carried out after it.

That is whatever had arrived by then, and, however long it is under way, what the stop's own client had asked for
before: each client numbers its requests in the order in which it asks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

MOST_CLIENTS = 256  # whose newest stop is kept


class OvertakenRequests:
    """The requests of one key that are void."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._arrived_by, self._reason = -math.inf, ""  # [s] monotonic
        self._stops: dict[str, tuple[int, str]] = {}  # by client: the number of its newest stop, and what it was

    def stop(self, reason: str, asked: Mapping[str, int], now: float) -> None:
        """A stop is handled at `now` [s] monotonic, for the clients that have `asked` for it with these numbers."""
        self._arrived_by, self._reason = now, reason
        for client, number in asked.items():
            before, _ = self._stops.pop(client, (0, ""))  # the newest are last
            self._stops[client] = (max(before, number), reason)
        while len(self._stops) > MOST_CLIENTS:
            del self._stops[next(iter(self._stops))]

    def refusal(self, client: str, number: int, arrived: float) -> str:
        """Why a request of `client` that has `arrived` at [s] monotonic is void, else empty; 0 is no number."""
        if arrived <= self._arrived_by:
            return f"{self._key}: {self._reason}"
        stop, reason = self._stops.get(client, (0, ""))
        if 0 < number < stop:
            return f"{self._key}: {reason} (this was request {number} of its client, the stop request {stop})"
        return ""
