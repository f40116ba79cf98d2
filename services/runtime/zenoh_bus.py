"""The bus over Zenoh: a client session of the router, with the robot's name as its namespace.

EVERY and LATCHED use Zenoh's advanced publishers and subscribers: sequence numbers, a cache at the
writer, and recovery by the reader, so that a router that restarts costs nothing.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import Any

import zenoh
import zenoh.ext as zx
from zenoh.handlers import Callback

from schemas.topics import Delivery
from services.runtime.bus import ENCODING, Answer, Arrival, Query
from services.runtime.errors import BusError
from services.runtime.zenoh_config import client_config

CACHE = 1024  # messages of an EVERY key that survive while the router is away
HEARTBEAT = 0.5  # [s] after which a reader notices that it misses the last message
CLOSE_TIMEOUT = 1.0  # [s]


class BusNotOpen(BusError):
    """The router did not take the session."""


class ZenohPublication:
    """A declared publisher, plain or advanced."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher

    def put(self, payload: bytes) -> None:
        self._publisher.put(payload)

    def close(self) -> None:
        self._publisher.undeclare()


class ZenohDeclaration:
    """Anything that Zenoh undeclares."""

    def __init__(self, *declared: Any) -> None:
        self._declared = declared

    def close(self) -> None:
        for each in self._declared:
            each.undeclare()


class ZenohQuery:
    """A query that is finalised by its one reply."""

    def __init__(self, query: zenoh.Query, key: str) -> None:
        self._query = query
        self.arrival = Arrival(key, _schema(query.encoding), bytes(query.payload or b""))

    def reply(self, schema: str, payload: bytes) -> None:
        with self._query as query:
            query.reply(self.arrival.key, payload, encoding=_encoding(schema))

    def fail(self, schema: str, payload: bytes) -> None:
        with self._query as query:
            query.reply_err(payload, encoding=_encoding(schema))


class Presence:
    """Knows whether somebody serves a key."""

    def __init__(self, session: zenoh.Session, key: str) -> None:
        self._served = threading.Event()
        self._querier = session.declare_querier(key)
        self._listener = self._querier.declare_matching_listener(self._on_status)
        if self._querier.matching_status.matching:  # type: ignore[attr-defined]
            self._served.set()

    def _on_status(self, status: zenoh.MatchingStatus) -> None:
        if status.matching:
            self._served.set()
        else:
            self._served.clear()

    def wait(self, timeout: float) -> bool:
        return self._served.wait(timeout)


class ZenohBus:
    """One node's session."""

    def __init__(self, host: str, port: int, robot: str) -> None:
        """Raises `BusNotOpen` where the router does not take the session."""
        try:
            self._session = zenoh.open(client_config(host, port, robot))
        except zenoh.ZError as error:
            raise BusNotOpen(str(error)) from error
        self._tokens: list[ZenohDeclaration] = []
        self._presence: dict[str, Presence] = {}
        self._lock = threading.Lock()
        _close_with_the_program(self)

    @property
    def is_connected(self) -> bool:
        return bool(self._session.info.routers_zid())

    def publish(self, key: str, schema: str, delivery: Delivery) -> ZenohPublication:
        encoding = _encoding(schema)
        if delivery is Delivery.LATEST:
            drop = zenoh.CongestionControl.DROP
            return ZenohPublication(self._session.declare_publisher(key, encoding=encoding, congestion_control=drop))
        latched = delivery is Delivery.LATCHED
        publisher = zx.declare_advanced_publisher(
            self._session,
            key,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.BLOCK,
            reliability=zenoh.Reliability.RELIABLE,
            cache=zx.CacheConfig(max_samples=1 if latched else CACHE),
            sample_miss_detection=zx.MissDetectionConfig(heartbeat=HEARTBEAT, sporadic_heartbeat=None),
            publisher_detection=latched,
        )
        return ZenohPublication(publisher)

    def subscribe(
        self,
        key: str,
        delivery: Delivery,
        on_arrival: Callable[[Arrival], None],
        on_miss: Callable[[int], None],
        own: bool = False,
    ) -> ZenohDeclaration:
        def on_sample(sample: zenoh.Sample) -> None:
            on_arrival(Arrival(key, _schema(sample.encoding), bytes(sample.payload)))

        origin = zenoh.Locality.ANY if own else zenoh.Locality.REMOTE
        if delivery is Delivery.LATEST:
            return ZenohDeclaration(self._session.declare_subscriber(key, on_sample, allowed_origin=origin))
        latched = delivery is Delivery.LATCHED
        subscriber = zx.declare_advanced_subscriber(
            self._session,
            key,
            on_sample,
            allowed_origin=origin,
            history=zx.HistoryConfig(detect_late_publishers=True, max_samples=1) if latched else None,
            recovery=zx.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        misses = subscriber.sample_miss_listener(lambda miss: on_miss(0 if latched else miss.nb))
        return ZenohDeclaration(misses, subscriber)

    def serve(self, key: str, on_query: Callable[[Query], None]) -> ZenohDeclaration:
        return ZenohDeclaration(
            self._session.declare_queryable(key, lambda query: on_query(ZenohQuery(query, key)), complete=True)
        )

    def wait_served(self, key: str, timeout: float) -> bool:
        with self._lock:
            presence = self._presence.get(key)
            if presence is None:
                presence = self._presence[key] = Presence(self._session, key)
        return presence.wait(timeout)

    def ask(
        self, key: str, schema: str, payload: bytes, timeout: float, on_answer: Callable[[Answer | None], None]
    ) -> None:
        answers: list[Answer] = []

        def on_reply(reply: zenoh.Reply) -> None:
            sample, error = reply.ok, reply.err
            if sample is not None:
                answers.append(Answer(True, _schema(sample.encoding), bytes(sample.payload)))
            elif error is not None and not _is_timeout(error):
                answers.append(Answer(False, _schema(error.encoding), bytes(error.payload)))

        def on_end() -> None:
            on_answer(answers[0] if answers else None)

        self._session.get(
            key,
            Callback(on_reply, on_end),
            payload=payload,
            encoding=_encoding(schema),
            timeout=timeout,
            target=zenoh.QueryTarget.BEST_MATCHING,
            consolidation=zenoh.ConsolidationMode.NONE,
        )

    def declare_alive(self, key: str) -> ZenohDeclaration:
        token = ZenohDeclaration(self._session.liveliness().declare_token(key))
        self._tokens.append(token)  # one that nobody holds would be undeclared
        return token

    def alive(self, pattern: str) -> set[str]:
        replies = self._session.liveliness().get(pattern, timeout=1.0)
        return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}

    def close(self) -> None:
        _open.discard(self)
        closing = threading.Thread(target=self._session.close, daemon=True, name="close")
        closing.start()
        closing.join(CLOSE_TIMEOUT)


_open: set[ZenohBus] = set()
_watch: list[threading.Thread] = []  # not a daemon, which would be cut off in the middle of closing


def _close_with_the_program(bus: ZenohBus) -> None:
    """A session that its program forgets to close would never let the process end: Zenoh's threads do not."""
    _open.add(bus)
    if not _watch:
        _watch.append(threading.Thread(target=_close_all_after_main, name="close"))
        _watch[0].start()


def _close_all_after_main() -> None:
    threading.main_thread().join()
    for bus in list(_open):
        bus.close()


def router_answers(host: str, port: int, timeout: float = 0.5) -> bool:
    """Whether something listens at the router's address."""
    try:
        socket.create_connection((host, port), timeout=timeout).close()
    except OSError:
        return False
    return True


def _encoding(schema: str) -> zenoh.Encoding:
    return zenoh.Encoding(ENCODING).with_schema(schema)


def _schema(encoding: zenoh.Encoding | None) -> str:
    kind, _, schema = str(encoding or "").partition(";")
    return schema if kind == ENCODING else ""


def _is_timeout(error: zenoh.ReplyError) -> bool:
    return not _schema(error.encoding)
