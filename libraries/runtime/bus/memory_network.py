"""The shared state of the in-memory buses of one robot: subscriptions, publications, queryables, liveliness tokens.

`MemoryNetwork.is_connected = False` is a router that is away: LATEST is lost, EVERY and LATCHED
wait, requests find nobody.
"""

from __future__ import annotations

import itertools
import threading
from collections import Counter, defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from gemelo.libraries.runtime.bus.branches import LOCAL
from gemelo.libraries.runtime.bus.interface import UNREAD, Arrival, BusReply, Query
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.topics import Delivery

KEPT = 1024  # messages that wait for the network to come back, as in Zenoh's publishers' cache


class Member(Protocol):
    """One node's bus, as the network knows it."""

    network: MemoryNetwork


@dataclass(eq=False)
class MemorySubscription:
    """One reader of one key."""

    bus: Member
    key: str
    on_arrival: Callable[[Arrival], None]
    own: bool

    def close(self) -> None:
        with self.bus.network.lock:
            self.bus.network.subscriptions[self.key].pop(self, None)


@dataclass(eq=False)
class MemoryPublication:
    """One writer of one key, with what it keeps for late joiners."""

    bus: Member
    key: str
    schema: str
    delivery: Delivery
    writer: str = ""
    instance: str = ""
    last: Arrival | None = None
    unsent: deque[Arrival] = field(default_factory=lambda: deque(maxlen=KEPT))

    def put(self, payload: bytes) -> None:
        network = self.bus.network
        if self.delivery is Delivery.LATEST and not network.subscriptions.get(self.key):
            return
        arrival = Arrival(self.key, self.schema, payload, self.writer, self.instance)
        with network.lock:
            if self.delivery is Delivery.LATCHED:
                self.last = arrival
            if network.is_connected:
                self.send(arrival)
            elif self.delivery is not Delivery.LATEST:
                self.unsent.append(arrival)

    def send(self, arrival: Arrival) -> None:
        readers = self.bus.network.subscriptions.get(self.key)
        for reader in tuple(readers) if readers else ():
            if reader.own or reader.bus is not self.bus:
                reader.on_arrival(arrival)

    def close(self) -> None:
        with self.bus.network.lock:
            self.bus.network.publications.pop(self, None)


@dataclass(eq=False)
class MemoryQueryable:
    """A queryable: the server of the requests of one key."""

    bus: Member
    key: str
    on_query: Callable[[Query], None]

    def close(self) -> None:
        network = self.bus.network
        with network.lock:
            if network.services.get(self.key) is self:
                del network.services[self.key]


@dataclass(eq=False)
class MemoryToken:
    """A liveliness token."""

    bus: Member
    key: str
    is_open: bool = True

    def close(self) -> None:
        with self.bus.network.lock:
            if self.is_open:
                self.is_open = False
                self.bus.network.count_token(self.key, -1)


@dataclass(eq=False)
class MemoryWatch:
    """Who wants to know whether the tokens of a pattern are there."""

    bus: Member
    pattern: str
    on_change: Callable[[str, bool], None]

    def close(self) -> None:
        with self.bus.network.lock:
            self.bus.network.watches.pop(self, None)


def matches(pattern: str, key: str) -> bool:
    """True if `key` is one of `pattern`, in which a `*` stands for one chunk."""
    wanted, chunks = pattern.split("/"), key.split("/")
    return len(wanted) == len(chunks) and all(want in ("*", chunk) for want, chunk in zip(wanted, chunks, strict=True))


class MemoryQuery:
    """A request on its way; the first answer counts, and after the time-out none does."""

    principal = LOCAL

    def __init__(
        self,
        arrival: Arrival,
        client: str,
        number: int,
        timeout: float,
        on_answer: Callable[[BusReply | None], None],
        clock: Clock = SYSTEM,
    ) -> None:
        """`timeout` in [s]; `on_answer` is called once, with None after it."""
        self.arrival, self.client, self.number, self.size = arrival, client, number, len(arrival.payload)
        self._on_answer = on_answer
        self._lock = threading.Lock()
        self._is_open = True
        self._timer = clock.later(timeout, lambda: self._finish(None))

    def reply(self, schema: str, payload: bytes) -> None:
        self._finish(BusReply(True, schema, payload))

    def fail(self, schema: str, payload: bytes) -> None:
        self._finish(BusReply(False, schema, payload))

    def drop(self) -> None:
        self._finish(UNREAD)

    def _finish(self, answer: BusReply | None) -> None:
        with self._lock:
            was_open, self._is_open = self._is_open, False
        self._timer.cancel()
        if was_open:
            self._on_answer(answer)


class MemoryNetwork:
    """The state that the buses of one robot share; dictionaries of None are sets in the order of their entries."""

    def __init__(self, clock: Clock = SYSTEM) -> None:
        self.clock = clock
        self.served = clock.condition()
        self.lock = self.served  # one for all
        self.subscriptions: defaultdict[str, dict[MemorySubscription, None]] = defaultdict(dict)
        self.publications: dict[MemoryPublication, None] = {}
        self.services: dict[str, MemoryQueryable] = {}
        self.tokens: Counter[str] = Counter()
        self.watches: dict[MemoryWatch, None] = {}
        self._names = itertools.count(1)
        self._is_connected = True

    def next_name(self) -> str:
        """The name of another bus, under which it asks."""
        return f"bus-{next(self._names)}"

    def count_token(self, key: str, change: int) -> None:
        """One more (1) or one less (-1) of the tokens `key`; tells who watches it. Call with the lock."""
        was, self.tokens[key] = self.tokens[key] > 0, self.tokens[key] + change
        if was != (self.tokens[key] > 0):
            for watch in [each for each in self.watches if matches(each.pattern, key)]:
                watch.on_change(key, not was)

    @property
    def is_connected(self) -> bool:
        return self._is_connected

    @is_connected.setter
    def is_connected(self, value: bool) -> None:
        with self.lock:
            self._is_connected = value
            for publication in self.publications if value else ():
                while publication.unsent:
                    publication.send(publication.unsent.popleft())
