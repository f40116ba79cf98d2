"""A bus within one process, for tests: the same promises as Zenoh's, without a router.

`MemoryNetwork.is_connected = False` is a router that is away: LATEST is lost, EVERY and LATCHED
wait, requests find nobody.
"""

from __future__ import annotations

import threading
from collections import Counter, defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from schemas.topics import Delivery
from services.runtime.bus import Answer, Arrival, Query

KEPT = 1024  # messages that wait for the network to come back, as in Zenoh's publishers' cache


@dataclass(eq=False)
class MemorySubscription:
    """One reader of one key."""

    bus: MemoryBus
    key: str
    on_arrival: Callable[[Arrival], None]
    own: bool

    def close(self) -> None:
        with self.bus.network.lock:
            self.bus.network.subscriptions[self.key].discard(self)


@dataclass(eq=False)
class MemoryPublication:
    """One writer of one key, with what it keeps for late joiners."""

    bus: MemoryBus
    key: str
    schema: str
    delivery: Delivery
    last: Arrival | None = None
    unsent: deque[Arrival] = field(default_factory=lambda: deque(maxlen=KEPT))

    def put(self, payload: bytes) -> None:
        arrival = Arrival(self.key, self.schema, payload)
        network = self.bus.network
        with network.lock:
            if self.delivery is Delivery.LATCHED:
                self.last = arrival
            if network.is_connected:
                self.send(arrival)
            elif self.delivery is not Delivery.LATEST:
                self.unsent.append(arrival)

    def send(self, arrival: Arrival) -> None:
        for reader in list(self.bus.network.subscriptions[self.key]):
            if reader.own or reader.bus is not self.bus:
                reader.on_arrival(arrival)

    def close(self) -> None:
        with self.bus.network.lock:
            self.bus.network.publications.discard(self)


@dataclass(eq=False)
class MemoryService:
    """Who answers the requests of one key."""

    bus: MemoryBus
    key: str
    on_query: Callable[[Query], None]

    def close(self) -> None:
        network = self.bus.network
        with network.lock:
            if network.services.get(self.key) is self:
                del network.services[self.key]


@dataclass(eq=False)
class MemoryToken:
    """A sign of life."""

    bus: MemoryBus
    key: str
    is_open: bool = True

    def close(self) -> None:
        with self.bus.network.lock:
            self.bus.network.tokens[self.key] -= self.is_open
            self.is_open = False


class MemoryQuery:
    """A request on its way; the first answer counts, and after the time-out none does."""

    def __init__(self, arrival: Arrival, timeout: float, on_answer: Callable[[Answer | None], None]) -> None:
        self.arrival = arrival
        self._on_answer = on_answer
        self._lock = threading.Lock()
        self._is_open = True
        self._timer = threading.Timer(timeout, self._finish, (None,))
        self._timer.daemon = True
        self._timer.start()

    def reply(self, schema: str, payload: bytes) -> None:
        self._finish(Answer(True, schema, payload))

    def fail(self, schema: str, payload: bytes) -> None:
        self._finish(Answer(False, schema, payload))

    def _finish(self, answer: Answer | None) -> None:
        with self._lock:
            was_open, self._is_open = self._is_open, False
        self._timer.cancel()
        if was_open:
            self._on_answer(answer)


class MemoryNetwork:
    """What the buses of one robot share."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.served = threading.Condition(self.lock)
        self.subscriptions: defaultdict[str, set[MemorySubscription]] = defaultdict(set)
        self.publications: set[MemoryPublication] = set()
        self.services: dict[str, MemoryService] = {}
        self.tokens: Counter[str] = Counter()
        self._is_connected = True

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


class MemoryBus:
    """One node's connection to a `MemoryNetwork`."""

    def __init__(self, network: MemoryNetwork) -> None:
        self.network = network
        self._declared: list[MemorySubscription | MemoryPublication | MemoryService | MemoryToken] = []

    @property
    def is_connected(self) -> bool:
        return self.network.is_connected

    def publish(self, key: str, schema: str, delivery: Delivery) -> MemoryPublication:
        publication = MemoryPublication(self, key, schema, delivery)
        with self.network.lock:
            self.network.publications.add(publication)
        self._declared.append(publication)
        return publication

    def subscribe(
        self,
        key: str,
        delivery: Delivery,
        on_arrival: Callable[[Arrival], None],
        on_miss: Callable[[int], None],
        own: bool = False,
    ) -> MemorySubscription:
        subscription = MemorySubscription(self, key, on_arrival, own)
        with self.network.lock:
            self.network.subscriptions[key].add(subscription)
            for publication in self.network.publications if delivery is Delivery.LATCHED else ():
                if publication.key == key and publication.last and (own or publication.bus is not self):
                    on_arrival(publication.last)
        self._declared.append(subscription)
        return subscription

    def serve(self, key: str, on_query: Callable[[Query], None]) -> MemoryService:
        service = MemoryService(self, key, on_query)
        with self.network.served:
            self.network.services[key] = service
            self.network.served.notify_all()
        self._declared.append(service)
        return service

    def wait_served(self, key: str, timeout: float) -> bool:
        with self.network.served:
            return self.network.served.wait_for(lambda: key in self.network.services and self.is_connected, timeout)

    def ask(
        self, key: str, schema: str, payload: bytes, timeout: float, on_answer: Callable[[Answer | None], None]
    ) -> None:
        with self.network.lock:
            service = self.network.services.get(key) if self.is_connected else None
        if service is None:
            on_answer(None)
        else:
            service.on_query(MemoryQuery(Arrival(key, schema, payload), timeout, on_answer))

    def declare_alive(self, key: str) -> MemoryToken:
        with self.network.lock:
            self.network.tokens[key] += 1
        token = MemoryToken(self, key)
        self._declared.append(token)
        return token

    def alive(self, pattern: str) -> set[str]:
        with self.network.lock:
            return {key for key, count in self.network.tokens.items() if count > 0 and _matches(pattern, key)}

    def close(self) -> None:
        for each in self._declared:
            each.close()
        self._declared.clear()


def _matches(pattern: str, key: str) -> bool:
    wanted, chunks = pattern.split("/"), key.split("/")
    return len(wanted) == len(chunks) and all(want in ("*", chunk) for want, chunk in zip(wanted, chunks, strict=True))
