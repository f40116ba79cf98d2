"""The declarations of a Zenoh session as the bus interface has them."""

from __future__ import annotations

import hashlib
import threading
import traceback
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any, Protocol

import zenoh
from zenoh.handlers import FifoChannel, Handler, RingChannel

from gemelo.libraries.runtime.bus.branches import LOCAL, asker_at, served_under
from gemelo.libraries.runtime.bus.interface import ENCODING, Arrival, IsFirst, never

MAX_SECRET = 32  # [bytes] of what a session says of itself
CLIENT_BYTES = 16  # of a client's name; chosen: as unguessable as the secret
MAX_DIGITS = 18  # of the number of a request
QUERIES = 1024  # of one key that wait for Python; chosen: a client's burst (requests/limits.py) fits


class ZenohPublication:
    """A declared publisher, plain or advanced; the writer's name and instance are attached to every message."""

    def __init__(self, publisher: Any, writer: str, instance: str) -> None:
        self._publisher = publisher
        self._signature = f"{writer} {instance}".strip().encode() or None

    def put(self, payload: bytes) -> None:
        self._publisher.put(payload, attachment=self._signature)

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

    def __init__(self, query: zenoh.Query, key: str, principal: str) -> None:
        """`key` is what is served, `principal` who asks."""
        self._query, self._key, self.principal = query, key, principal
        self.client, self.number = asker(bytes(query.attachment or b""), principal)
        self.size = 0 if query.payload is None else len(query.payload)

    @cached_property
    def arrival(self) -> Arrival:
        return Arrival(self._key, schema_in(self._query.encoding), bytes(self._query.payload or b""))

    def reply(self, schema: str, payload: bytes) -> None:
        with self._query as query:
            query.reply(query.key_expr, payload, encoding=encoding_of(schema))

    def fail(self, schema: str, payload: bytes) -> None:
        with self._query as query:
            query.reply_err(payload, encoding=encoding_of(schema))

    def drop(self) -> None:
        with self._query:
            pass


class ZenohQueryable:
    """Hands the queries of one key to `on_query` in a thread of its own.

    Zenoh's thread, which brings the queries of all keys, only puts them into a channel: it never waits for Python, so
    that a flood of one key does not delay the others. Of a full channel the oldest query is lost, unless it is urgent;
    of urgent ones those that are first are read before all others that are there.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        on_query: Callable[[ZenohQuery], None],
        urgent: bool,
        is_verified: bool,
        is_first: IsFirst = never,
    ) -> None:
        """`is_verified`: the router lets everyone ask as its own principal alone; else all are `local`."""
        self.key, self.is_urgent = key, urgent  # is_urgent: while it is declared
        self._on_query, self._is_verified, self._is_first = on_query, is_verified, is_first
        self._waiting: deque[zenoh.Query] = deque()  # that were taken from the channel and are not first
        channel: Any = FifoChannel(QUERIES) if urgent else RingChannel(QUERIES)
        self._queryable: Any = session.declare_queryable(served_under(key), channel, complete=True)
        self._thread = threading.Thread(target=self._run, args=(self._queryable.handler,), daemon=True, name=key)
        self._thread.start()

    def close(self) -> None:
        self.is_urgent = False
        self._queryable.undeclare()

    def join(self, timeout: float) -> None:
        """Waits up to `timeout` [s] for the end of the thread: one that outlives the interpreter would abort it."""
        if self._thread is not threading.current_thread():
            self._thread.join(timeout)

    def _run(self, queries: Handler[zenoh.Query]) -> None:
        with suppress(zenoh.ZError):  # the channel is closed
            while True:
                query: zenoh.Query | None = queries.try_recv() if self._waiting else queries.recv()
                while query is not None:
                    self._take(query)
                    query = queries.try_recv() if len(self._waiting) < QUERIES else None
                if self._waiting:
                    self._hand_over(self._waiting.popleft())

    def _take(self, query: zenoh.Query) -> None:
        if self._is_first is never or self._is_first(bytes(query.payload or b"")):
            self._hand_over(query)
        else:
            self._waiting.append(query)

    def _hand_over(self, query: zenoh.Query) -> None:
        try:
            if (principal := asker_at(str(query.key_expr))) is None:  # it asks in the name of many
                with query:
                    return
            self._on_query(ZenohQuery(query, self.key, principal if self._is_verified else LOCAL))
        except Exception:
            with suppress(OSError):  # a disk that is full takes no words
                traceback.print_exc()


class ServerMonitor:
    """Monitors whether a node serves what is asked for under `key`."""

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


def asked_by(secret: str, number: int) -> bytes:
    """What goes with a request: the secret of the session that asks, and the number of the request."""
    return f"{secret}:{number}".encode()


def asker(attached: bytes, principal: str) -> tuple[str, int]:
    """The client that asks, empty where it names none, and the number of its request, 0 where there is none.

    The client is a hash of the session's secret: who reads it in a recording or an answer cannot ask in its name, and
    a server that has read the secret can do so with its own certificate alone, which makes it another client.
    """
    secret, _, number = attached[: MAX_SECRET + 1 + MAX_DIGITS].partition(b":")
    if not secret:
        return "", 0
    digest = hashlib.blake2b(secret[:MAX_SECRET], digest_size=CLIENT_BYTES, key=principal.encode()[:64]).hexdigest()
    return digest, int(number) if number.isdigit() else 0


def encoding_of(schema: str) -> zenoh.Encoding:
    return zenoh.Encoding(ENCODING).with_schema(schema)


def schema_in(encoding: zenoh.Encoding | None) -> str:
    kind, _, schema = str(encoding or "").partition(";")
    return schema if kind == ENCODING else ""


def signature_in(sample: zenoh.Sample) -> tuple[str, str]:
    """The name and the instance that the writer attached; empty where there is none."""
    attached = sample.attachment
    writer, _, instance = ("" if attached is None else bytes(attached).decode(errors="replace")).partition(" ")
    return writer, instance


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
