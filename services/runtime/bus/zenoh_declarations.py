"""The declarations of a Zenoh session as the bus interface has them."""

from __future__ import annotations

import threading
from typing import Any, Protocol

import zenoh

from services.runtime.bus.interface import ENCODING, Arrival

MAX_CLIENT_NAME = 32  # [bytes] of what a client says of itself


class ZenohPublication:
    """A declared publisher, plain or advanced; the writer's name is attached to every message."""

    def __init__(self, publisher: Any, writer: str) -> None:
        self._publisher = publisher
        self._writer = writer.encode() or None

    def put(self, payload: bytes) -> None:
        self._publisher.put(payload, attachment=self._writer)

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
        self.arrival = Arrival(key, schema_in(query.encoding), bytes(query.payload or b""))
        self.client = bytes(query.attachment or b"")[:MAX_CLIENT_NAME].hex()

    def reply(self, schema: str, payload: bytes) -> None:
        with self._query as query:
            query.reply(self.arrival.key, payload, encoding=encoding_of(schema))

    def fail(self, schema: str, payload: bytes) -> None:
        with self._query as query:
            query.reply_err(payload, encoding=encoding_of(schema))


class ServerMonitor:
    """Monitors whether a node serves a key."""

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
        """True if a node serves the key; waits up to `timeout` [s] for it."""
        return self._served.wait(timeout)


def encoding_of(schema: str) -> zenoh.Encoding:
    return zenoh.Encoding(ENCODING).with_schema(schema)


def schema_in(encoding: zenoh.Encoding | None) -> str:
    kind, _, schema = str(encoding or "").partition(";")
    return schema if kind == ENCODING else ""


def writer_in(sample: zenoh.Sample) -> str:
    """The name that the writer attached; empty where there is none."""
    attached = sample.attachment
    return "" if attached is None else bytes(attached).decode(errors="replace")


def is_timeout(error: zenoh.ReplyError) -> bool:
    return not schema_in(error.encoding)


class Closable(Protocol):
    """A session."""

    def close(self) -> None: ...


_open: set[Closable] = set()
_watch: list[threading.Thread] = []  # not a daemon, which would be cut off in the middle of closing


def close_at_exit(session: Closable) -> None:
    """Closes it when the main thread ends, unless `forget` is called before."""
    _open.add(session)
    if not _watch:
        _watch.append(threading.Thread(target=_close_all_after_main, name="close"))
        _watch[0].start()


def forget(session: Closable) -> None:
    """It has been closed."""
    _open.discard(session)


def _close_all_after_main() -> None:
    threading.main_thread().join()
    for session in list(_open):
        session.close()
