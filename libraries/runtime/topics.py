"""Publishers and subscriptions of the topics in schemas/topics.py."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from gemelo.libraries.runtime.bus.branches import is_of_many, name_in
from gemelo.libraries.runtime.bus.interface import Arrival, Bus
from gemelo.libraries.runtime.bus.wire import Encoded, encoded, from_arrival, schema_of
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.loop.loop import Loop
from gemelo.libraries.runtime.loop.task_queue import ArrivalQueue, EveryQueue, Gaps, LatestQueue, UnreadQueue
from gemelo.schemas.message import BadMessage, Message
from gemelo.schemas.system import TopicStatistics
from gemelo.schemas.topics import ANY, Delivery, Topic

M = TypeVar("M", bound=Message)

DEFAULT_STALE_AFTER = 1.0  # [s] after which a topic without a rate counts as stale
PERIODS_TO_STALE = 5.0


class Warn(Protocol):
    """A function that logs a warning."""

    def __call__(self, text: str, /) -> None: ...


class Publisher(Generic[M]):
    """The right to publish on one topic."""

    def __init__(self, bus: Bus, topic: Topic[M], writer: str, instance: str = "") -> None:
        """`writer` is the name of the node that publishes, `instance` that of its process (bus/identity.py)."""
        self.topic = topic
        signed = instance if topic.delivery is Delivery.LATCHED else ""
        self._publication = bus.publish(topic.key, schema_of(topic.message), topic.delivery, writer, signed)

    def put(self, message: M | Encoded[M]) -> None:
        """Raises `TypeError` for another message than the table's, `TooLarge` where it is too large.

        With one that was `encoded` before, as a message of what has changed is, neither can happen after the change.
        """
        self._publication.put(self.encoded(message).payload)

    def close(self) -> None:
        """Nothing is published any more, and a late joiner gets no last message."""
        self._publication.close()

    def encoded(self, message: M | Encoded[M]) -> Encoded[M]:
        """What `put` would send; raises as it does."""
        ready = encoded(message)
        if type(ready.message) is not self.topic.message:
            found = type(ready.message).__name__
            raise TypeError(f"{self.topic.key} carries {schema_of(self.topic.message)}, not {found}")
        return ready


class Subscription(Generic[M]):
    """Decodes what arrives on one topic and hands it to `handler` in the thread of logic."""

    def __init__(
        self,
        bus: Bus,
        loop: Loop,
        topic: Topic[M],
        handler: Callable[[M], object],
        warn: Warn,
        own: bool,
        batch: float | None,
        on_signed: Callable[[M, str], object] | None = None,
        queue: UnreadQueue | None = None,
    ) -> None:
        """With `batch` [s] the messages are handled together, once in this time; with 0 each as it comes, but all.

        `on_signed` takes the place of `handler`, and is told the node that wrote the message too; of a LATCHED topic,
        whose node the table names, the instance of that node.
        What lands in `queue` waits there for `take_in`.
        """
        self.topic = topic
        self._handler, self._on_signed, self._warn = handler, on_signed, warn
        self._received, self._bad, self._lost_said = 0, 0, False
        self.on_close: Callable[[], object] | None = None
        self._loop = loop
        self._queue: ArrivalQueue = self._queue_for(batch) if queue is None else queue
        self._declaration = bus.subscribe(topic.key, topic.delivery, self._queue.on_arrival, self._queue.on_miss, own)

    def _queue_for(self, batch: float | None) -> ArrivalQueue:
        if batch:
            queue = EveryQueue(None, self._handle)
            self._loop.every(batch, queue.deliver_all)
            return queue
        latest = self.topic.delivery is Delivery.LATEST and batch is None
        return (LatestQueue if latest else EveryQueue)(self._loop.tasks, self._handle)

    @property
    def statistics(self) -> TopicStatistics:
        unread = self._queue.passed_over if isinstance(self._queue, UnreadQueue) else 0
        received = self._received + unread
        return TopicStatistics(key=self.topic.key, received=received, dropped=self._queue.dropped, bad=self._bad)

    def close(self) -> None:
        """Nothing is handed over any more, and its node no longer counts it."""
        on_close, self.on_close = self.on_close, None
        if on_close is not None:
            on_close()
        self._declaration.close()
        if isinstance(self._queue, EveryQueue):
            self._loop.forget(self._queue.deliver_all)

    def report_losses(self) -> None:
        """Says once that an EVERY topic has lost messages."""
        if self._queue.dropped and self.topic.delivery is not Delivery.LATEST and not self._lost_said:
            self._lost_said = True
            self._warn(f"{self.topic.key}: {self._queue.dropped} messages lost (counted from now on in statistics)")

    def take_in(self, arrival: Arrival) -> bool:
        """Hands over what has waited in a queue of its own; False where it is bad."""
        before = self._received
        self._handle(arrival)
        return self._received > before

    def _handle(self, arrival: Arrival) -> None:
        try:
            self._require_writer(arrival)
            message = from_arrival(self.topic.message, arrival)
            _require_own_name(self.topic.key, message, arrival.writer)
        except BadMessage as error:
            self._bad += 1
            if self._bad == 1:
                self._warn(f"{self.topic.key}: dropped a bad message: {error} (further ones are only counted)")
            return
        self._received += 1
        if self._on_signed is not None:
            is_latched = self.topic.delivery is Delivery.LATCHED
            self._loop.carry_out(self._on_signed, message, arrival.instance if is_latched else arrival.writer)
        else:
            self._loop.carry_out(self._handler, message)

    def _require_writer(self, arrival: Arrival) -> None:
        """Raises `BadMessage` for a latched message of a stranger, which would stay valid until the writer's next.

        A node's name is its own while it lives (`identity.py`), so the writer that the table names is one process.
        """
        wanted = self.topic.writer
        if self.topic.delivery is Delivery.LATCHED and wanted != ANY and arrival.writer != wanted:
            who = f'node "{arrival.writer}"' if arrival.writer else "a stranger without a node's name"
            raise BadMessage(f'it comes from {who}, and only "{wanted}" writes this key')


def _require_own_name(key: str, message: Message, writer: str) -> None:
    """Raises `BadMessage` for a message of a key of many nodes that speaks of another node than its writer."""
    if not is_of_many(key):
        return
    said = getattr(message, "node", "")
    if not writer:
        raise BadMessage("it comes from nobody's branch (libraries/runtime/bus/branches.py)")
    if said and said != name_in(writer):
        raise BadMessage(f'it speaks of node "{said[:64]}", and comes from "{writer}"')


class Latest(Generic[M]):
    """The newest message of a topic."""

    def __init__(self, topic: Topic[M], clock: Clock = SYSTEM) -> None:
        self.topic = topic
        self._clock = clock
        self._message: M | None = None
        self._gaps = Gaps()
        self._arrived = 0.0  # [s] monotonic
        self._arrived_unix = 0  # [ns]

    @property
    def message(self) -> M | None:
        """None before the first."""
        self._look()
        return self._message

    def on_message(self, message: M) -> None:
        arrived = self._clock.monotonic()
        self._gaps.on_arrival(arrived)
        self._message = message
        self._arrived, self._arrived_unix = arrived, self._clock.unix()

    def age(self, now: int | None = None) -> float:
        """[s] since the message came, up to `now` [ns UNIX] where given; infinite before the first."""
        self._look()
        if self._message is None:
            return float("inf")
        return self._clock.monotonic() - self._arrived if now is None else (now - self._arrived_unix) * 1e-9

    @property
    def is_stale(self) -> bool:
        """Older than five periods of the topic's rate, or never received; a latched message stays valid."""
        age = self.age()
        if self._message is not None and self.topic.delivery is Delivery.LATCHED:
            return False
        return age > self._stale_after()

    def _stale_after(self) -> float:
        """[s]; the period at rest counts as far as the last messages came that slowly, or while there is no other."""
        topic = self.topic
        if topic.rate is None:
            return DEFAULT_STALE_AFTER
        if topic.rest_rate is None:
            return PERIODS_TO_STALE / topic.rate
        at_rest = 1.0 / topic.rest_rate
        return PERIODS_TO_STALE * min(max(self._gaps.longest(at_rest), 1.0 / topic.rate), at_rest)

    def _look(self) -> None:
        """Takes in what has come since; here that is done as it comes."""


class LatestOnDemand(Latest[M]):
    """As `Latest`, but a message is decoded when somebody asks for it, in the thread that asks.

    For what comes often and is looked at now and then; the age counts from when it came.
    """

    def __init__(self, bus: Bus, loop: Loop, topic: Topic[M], warn: Warn) -> None:
        super().__init__(topic, bus.clock)
        self._queue, self._looking = UnreadQueue(bus.clock), threading.Lock()
        self._gaps = self._queue.gaps
        self.subscription = Subscription(bus, loop, topic, self._keep, warn, False, None, queue=self._queue)

    def _keep(self, message: M) -> None:
        self._message = message

    def _look(self) -> None:
        with self._looking:
            arrived = self._queue.take()
            if arrived is not None and self.subscription.take_in(arrived.arrival):
                self._arrived, self._arrived_unix = arrived.at, arrived.at_unix
