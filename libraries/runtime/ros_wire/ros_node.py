"""A node of ROS 2 on a Zenoh router, as rmw_zenoh_cpp makes one: tokens, publishers, servers and clients.

Its session is a client without a namespace: rmw_zenohd does not broker between peers, and the keys are those of ROS.
Callbacks of Zenoh only hand over to the node's own queue.
"""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable
from typing import Any, Protocol

import zenoh
import zenoh.ext as zx

from gemelo.libraries.runtime.bus.zenoh_config import settings
from gemelo.libraries.runtime.bus.zenoh_declarations import ZenohDeclaration, close_at_exit, forget
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.errors import BusError
from gemelo.libraries.runtime.ros_wire.names import (
    DEFAULT,
    NO_GID,
    TOKENS,
    Attachment,
    EntityKind,
    NodeName,
    Qos,
    RosType,
    data_key,
    endpoint_token,
    gid_of,
    node_token,
    read_attachment,
)
from gemelo.schemas.reasons import because, remedy

HEARTBEAT = 0.5  # [s] as rmw_zenoh_cpp has it: by it a late reader notices that it misses the last message
CLOSE_TIMEOUT = 1.0  # [s]
OPEN_MS = 2000  # that the router may take
MOST_WAITING = 64  # questions to one service; chosen: more than all tools of a person ask at once

Post = Callable[[Callable[[], None]], object]


class RosPublication(Protocol):
    """The right to publish on one topic."""

    def put(self, payload: bytes, stamp: int) -> None:
        """`stamp` [ns] UNIX time of the source."""
        ...


class RosQuery(Protocol):
    """A question of a ROS client that waits for exactly one reply."""

    @property
    def payload(self) -> bytes: ...

    @property
    def client(self) -> bytes:
        """The GID of the client; empty where it does not say."""
        ...

    def reply(self, payload: bytes) -> None: ...

    def drop(self) -> None:
        """Ends it without a reply."""
        ...


class ZenohRosPublication:
    """A publisher with its token, which counts what it sends."""

    def __init__(self, publisher: Any, token: str) -> None:
        self._publisher, self._gid, self._numbers = publisher, gid_of(token), itertools.count(1)

    def put(self, payload: bytes, stamp: int) -> None:
        attachment = Attachment(next(self._numbers), stamp, self._gid)
        self._publisher.put(payload, attachment=attachment.packed())


class ZenohRosQuery:
    """A query that is finalised by its one reply, which has the request's number and GID."""

    def __init__(self, query: zenoh.Query, clock: Clock) -> None:
        self._query, self._clock = query, clock
        self.payload = bytes(query.payload or b"")
        self._asked = read_attachment(bytes(query.attachment or b""))

    @property
    def client(self) -> bytes:
        return self._asked.gid if self._asked is not None else b""

    def reply(self, payload: bytes) -> None:
        asked = self._asked or Attachment(1, 0, NO_GID)
        attachment = Attachment(asked.sequence, self._clock.unix(), asked.gid)
        with self._query as query:
            query.reply(query.key_expr, payload, attachment=attachment.packed())

    def drop(self) -> None:
        with self._query:
            pass


class Waiting:
    """The questions to one service that wait for the node's own thread: a flood of them is dropped."""

    def __init__(self, post: Post) -> None:
        self._post, self._count, self._lock = post, 0, threading.Lock()

    def put(self, task: Callable[[], None]) -> bool:
        """False where too many wait."""
        with self._lock:
            if self._count >= MOST_WAITING:
                return False
            self._count += 1
        self._post(lambda: self._run(task))
        return True

    def _run(self, task: Callable[[], None]) -> None:
        with self._lock:
            self._count -= 1
        task()


class NewestMessage:
    """The newest message of a topic until the node's own thread takes it."""

    def __init__(self, post: Post, on_message: Callable[[bytes], None]) -> None:
        self._post, self._on_message, self._lock = post, on_message, threading.Lock()
        self._payload: bytes | None = None

    def put(self, payload: bytes) -> None:
        with self._lock:
            is_first, self._payload = self._payload is None, payload
        if is_first:
            self._post(self._take)

    def _take(self) -> None:
        with self._lock:
            payload, self._payload = self._payload, None
        if payload is not None:
            self._on_message(payload)


class RosNode:
    """One node of ROS 2; everything that it declares lasts until it is closed."""

    def __init__(self, locator: str, name: NodeName, post: Post, clock: Clock = SYSTEM) -> None:
        """`locator` as Zenoh has it, `tcp/host:port`; `post` runs a task in the node's own thread.

        Raises `BusError` where no router takes the session.
        """
        self.name, self._post, self._clock = name, post, clock
        self._session = opened(locator)
        self._id = str(self._session.info.zid())
        self._numbers = itertools.count(1)
        self._kept: list[Any] = [self._declared(node_token(name, self._id))]
        close_at_exit(self)

    @property
    def is_connected(self) -> bool:
        return bool(self._session.info.routers_zid())

    def publisher(self, name: str, kind: RosType, qos: Qos = DEFAULT) -> ZenohRosPublication:
        """A publisher of a topic, `name` relative to the node's namespace unless it begins with a slash."""
        full = self.name.full(name)
        key, drop = data_key(self.name.domain, full, kind), zenoh.CongestionControl.DROP
        publisher: Any
        if qos.is_latched:
            publisher = zx.declare_advanced_publisher(
                self._session,
                key,
                congestion_control=drop,
                cache=zx.CacheConfig(max_samples=qos.depth),
                publisher_detection=True,
                sample_miss_detection=zx.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT),
            )
        else:
            publisher = self._session.declare_publisher(key, congestion_control=drop)
        token = self._token(EntityKind.PUBLISHER, full, kind, qos)
        self._kept += [publisher, self._declared(token)]
        return ZenohRosPublication(publisher, token)

    def serve(self, name: str, kind: RosType, on_query: Callable[[RosQuery], None]) -> None:
        """`on_query(query)` runs in the node's own thread for every question to the service; it replies, once."""
        full = self.name.full(name)

        waiting = Waiting(self._post)

        def hand_over(query: zenoh.Query) -> None:
            asked = ZenohRosQuery(query, self._clock)
            if not waiting.put(lambda: on_query(asked)):
                asked.drop()

        key = data_key(self.name.domain, full, kind)
        queryable = self._session.declare_queryable(key, hand_over, complete=True)
        self._kept += [queryable, self._declared(self._token(EntityKind.SERVER, full, kind, DEFAULT))]

    def subscribe(self, name: str, kind: RosType, on_message: Callable[[bytes], None]) -> None:
        """`on_message(payload)` runs in the node's own thread for the newest message of a topic alone."""
        full, newest = self.name.full(name), NewestMessage(self._post, on_message)

        def on_sample(sample: zenoh.Sample) -> None:
            newest.put(bytes(sample.payload))

        subscriber = self._session.declare_subscriber(data_key(self.name.domain, full, kind), on_sample)
        self._kept += [subscriber, self._declared(self._token(EntityKind.SUBSCRIPTION, full, kind, DEFAULT))]

    def watch_clients(self, on_change: Callable[[bytes, bool], None]) -> None:
        """`on_change(gid, is_there)` runs in the node's own thread for every service client of the domain."""

        def on_token(sample: zenoh.Sample) -> None:
            token, is_there = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
            self._post(lambda: on_change(gid_of(token), is_there))

        pattern = f"{TOKENS}/{self.name.domain}/*/*/*/{EntityKind.CLIENT}/**"
        self._kept.append(self._session.liveliness().declare_subscriber(pattern, on_token, history=True))

    def close(self) -> None:
        """Ends everything declared here; never hangs."""
        forget(self)
        closing = threading.Thread(target=self._session.close, daemon=True, name="close")
        closing.start()
        closing.join(CLOSE_TIMEOUT)

    def _token(self, entity: EntityKind, full: str, kind: RosType, qos: Qos) -> str:
        return endpoint_token(self.name, self._id, next(self._numbers), entity, full, kind, qos)

    def _declared(self, token: str) -> ZenohDeclaration:
        return ZenohDeclaration(self._session.liveliness().declare_token(token))


def opened(locator: str) -> zenoh.Session:
    """A client's session without a namespace; raises `BusError` where no router takes it."""
    try:
        return zenoh.open(_config(locator))
    except zenoh.ZError as error:
        why = because("ros.router.away", remedy("ros_router_start"), router=locator, error=str(error))
        raise BusError(why) from error


def _config(locator: str) -> zenoh.Config:
    """Timestamps are on, without which no late joiner gets what is latched."""
    connect = {
        "endpoints": [locator],
        "timeout_ms": OPEN_MS,
        "exit_on_failure": True,
        "retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
    }
    return zenoh.Config.from_json5(json.dumps(settings({}) | {"mode": "client", "connect": connect}))
