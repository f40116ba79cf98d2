"""Requests that a stop has overtaken: none that was asked for before a stop is carried out after it.

That is whatever had arrived by then, and, however long it is under way, what the stop's own client had asked for
before: each client numbers its requests in the order in which it asks. A client is named by a secret of its own
(bus/zenoh_declarations.py), so that no other's stop has its numbers; and one of its own whose number is far above all
before counts as a stop without a number, so that an error in one number refuses nothing for good.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from gemelo.schemas.reasons import Reason, because

MOST_CLIENTS = 4096  # whose newest numbers are kept; chosen: what a flood of new names fills in several seconds
MOST_JUMP = (
    1_000_000  # chosen: requests to all other nodes between two to one, more than half an hour of a client's pace
)


class NewestOf:
    """A number for each of the clients that have sent something last, and why."""

    def __init__(self) -> None:
        self._of: dict[str, tuple[int, Reason | None]] = {}

    def __getitem__(self, client: str) -> tuple[int, Reason | None]:
        return self._of.get(client, (0, None))

    def put(self, client: str, number: int, reason: Reason | None = None) -> None:
        """The higher number stays, with the newest reason."""
        before, _ = self._of.pop(client, (0, None))  # the newest are last
        self._of[client] = (max(before, number), reason)
        while len(self._of) > MOST_CLIENTS:
            del self._of[next(iter(self._of))]


class OvertakenRequests:
    """The requests of one key that are void."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._arrived_by = -math.inf  # [s] monotonic
        self._reason: Reason | None = None
        self._stops = NewestOf()  # the number of each client's newest stop, and what it was
        self._seen = NewestOf()  # the highest number of each client's requests

    def stop(self, reason: Reason, asked: Mapping[str, int], now: float) -> None:
        """A stop is handled at `now` [s] monotonic, for the clients that have `asked` for it with these numbers."""
        self._arrived_by, self._reason = now, reason
        for client, number in asked.items():
            if number - max(self._seen[client][0], self._stops[client][0]) <= MOST_JUMP:
                self._stops.put(client, number, reason)

    def refusal(self, client: str, number: int, arrived: float) -> Reason | None:
        """Why a request of `client` that has `arrived` at [s] monotonic is void, else None; 0 is no number."""
        self._seen.put(client, number)
        if arrived <= self._arrived_by and self._reason is not None:
            return because("request.void", self._reason, request=self._key)
        stop, reason = self._stops[client]
        if 0 < number < stop and reason is not None:
            return because("request.void.overtaken", reason, request=self._key, number=number, stop=stop)
        return None
