"""A bus within one process, for simulations and tests: the same promises as Zenoh's, without a router."""

from __future__ import annotations

import itertools
from collections.abc import Callable

from gemelo.libraries.runtime.bus.interface import UNREAD, Arrival, BusReply, Declaration, IsFirst, Query, never
from gemelo.libraries.runtime.bus.memory_network import (
    MemoryNetwork,
    MemoryPublication,
    MemoryQuery,
    MemoryQueryable,
    MemorySubscription,
    MemoryToken,
    MemoryWatch,
    matches,
)
from gemelo.libraries.runtime.bus.pace import Pace
from gemelo.libraries.runtime.clock import Clock
from gemelo.schemas.topics import Delivery

__all__ = ["MemoryBus", "MemoryNetwork"]


class MemoryBus:
    """One node's connection to a `MemoryNetwork`."""

    def __init__(self, network: MemoryNetwork, pace: Pace | None = None) -> None:
        """`pace` is that of its requests."""
        self.network = network
        self._pace = pace or Pace(monotonic=network.clock.monotonic, sleep=network.clock.sleep)
        self._declared: list[Declaration] = []
        self._numbers = itertools.count(1)
        self._name = network.next_name()

    @property
    def clock(self) -> Clock:
        return self.network.clock

    @property
    def is_connected(self) -> bool:
        return self.network.is_connected

    @property
    def router(self) -> str:
        return "memory" if self.is_connected else ""

    @property
    def certificate(self) -> str:
        return ""

    @property
    def common_name(self) -> str:
        return ""

    def require_reconnection(self) -> None:
        pass

    def publish(
        self, key: str, schema: str, delivery: Delivery, writer: str = "", instance: str = ""
    ) -> MemoryPublication:
        publication = MemoryPublication(self, key, schema, delivery, writer, instance)
        with self.network.lock:
            self.network.publications[publication] = None
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
            self.network.subscriptions[key][subscription] = None
            for publication in self.network.publications if delivery is Delivery.LATCHED else ():
                if publication.key == key and publication.last and (own or publication.bus is not self):
                    on_arrival(publication.last)
        self._declared.append(subscription)
        return subscription

    def serve(
        self, key: str, on_query: Callable[[Query], None], urgent: bool = False, is_first: IsFirst = never
    ) -> MemoryQueryable:
        """None waits here."""
        service = MemoryQueryable(self, key, on_query)
        with self.network.served:
            self.network.services[key] = service
            self.network.served.notify_all()
        self._declared.append(service)
        return service

    def wait_served(self, key: str, timeout: float) -> bool:
        """True if a node serves `key`; waits up to `timeout` [s] for it."""
        with self.network.served:
            return self.network.served.wait_for(lambda: key in self.network.services and self.is_connected, timeout)

    def take_number(self) -> int:
        """The number of a request that is asked for now."""
        return next(self._numbers)

    def ask(
        self,
        key: str,
        schema: str,
        payload: bytes,
        timeout: float,
        on_answer: Callable[[BusReply | None], None],
        urgent: bool = False,
        number: int = 0,
    ) -> None:
        """Sends one request with `timeout` [s] for its answer; it waits for its turn unless it is urgent."""
        number = number or self.take_number()
        if not urgent:
            self._pace.wait_for_turn()
        with self.network.lock:
            service = self.network.services.get(key) if self.is_connected else None
        if service is None:
            on_answer(UNREAD)
        else:
            arrival = Arrival(key, schema, payload)
            service.on_query(MemoryQuery(arrival, self._name, number, timeout, on_answer, self.clock))

    def declare_alive(self, key: str) -> MemoryToken:
        with self.network.lock:
            self.network.count_token(key, 1)
        token = MemoryToken(self, key)
        self._declared.append(token)
        return token

    def watch_alive(self, key: str, on_change: Callable[[bool], None]) -> MemoryWatch:
        return self.watch_tokens(key, lambda _, is_there: on_change(is_there))

    def watch_tokens(self, pattern: str, on_change: Callable[[str, bool], None]) -> MemoryWatch:
        watch = MemoryWatch(self, pattern, on_change)
        with self.network.lock:
            self.network.watches[watch] = None
            for key in sorted(self.alive(pattern)):
                on_change(key, True)
        self._declared.append(watch)
        return watch

    def alive(self, pattern: str) -> set[str]:
        with self.network.lock:
            return {key for key, count in self.network.tokens.items() if count > 0 and matches(pattern, key)}

    def close(self) -> None:
        for each in self._declared:
            each.close()
        self._declared.clear()
