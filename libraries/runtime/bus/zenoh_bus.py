"""The bus over Zenoh: a client session of the router, with the robot's name as its namespace.

Urgent keys are served in a session of their own: what floods the others fills neither its link nor its thread.
EVERY and LATCHED use Zenoh's advanced publishers and subscribers: sequence numbers, a cache at the
writer, and recovery by the reader, so that a router that restarts costs nothing.
"""

from __future__ import annotations

import itertools
import secrets
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import zenoh
import zenoh.ext as zx
from zenoh.handlers import Callback

from gemelo.libraries.runtime.bus.branches import (
    LOCAL,
    asked_under,
    is_of_many,
    principal_of,
    read_under,
    writer_at,
    written_under,
)
from gemelo.libraries.runtime.bus.dead_links import end_dead_links
from gemelo.libraries.runtime.bus.interface import UNREAD, Arrival, BusReply, IsFirst, Query, never
from gemelo.libraries.runtime.bus.pace import Pace
from gemelo.libraries.runtime.bus.recognition import Recognition
from gemelo.libraries.runtime.bus.zenoh_config import client_config
from gemelo.libraries.runtime.bus.zenoh_declarations import (
    MAX_SECRET,
    ServerMonitor,
    ZenohDeclaration,
    ZenohPublication,
    ZenohQueryable,
    asked_by,
    close_at_exit,
    encoding_of,
    forget,
    is_timeout,
    schema_in,
    signature_in,
)
from gemelo.libraries.runtime.clock import SYSTEM
from gemelo.libraries.runtime.errors import BusError
from gemelo.schemas.actions import GoalEnd
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.device import DeviceEvent, GatewayInputs
from gemelo.schemas.planning import AnswerInputs, PlanInputs
from gemelo.schemas.reasons import because
from gemelo.schemas.system import Exchange, LogRecord, NodeStatistics
from gemelo.schemas.topics import Delivery

# Messages of an EVERY key that survive while the router is away: chosen, a minute of what is said most often (commands
# and their acknowledgements, 22 a second). What is said less often fills as many only within the hour, and a process
# grows by it all the while: measured, 2 MB/h of the gateway.
CACHE = 1024
CACHE_OF = {
    **{each.__name__: 512 for each in (DeviceEvent, LogRecord)},  # 1 in 2 s while the arm moves, and then many at once
    **{each.__name__: 128 for each in (GatewayInputs, GoalEnd, NodeStatistics)},  # at most 2 a second
    **{each.__name__: 64 for each in (Exchange, PlanInputs, AnswerInputs)},  # one a move, of up to 50 kB
}
HEARTBEAT = 0.5  # [s] after which a reader notices that it misses the last message
CLOSE_TIMEOUT = 1.0  # [s]
MOST_OF_A_TIMEOUT = 0.9  # what ends without an answer after that has timed out
TO_ANSWER = 1.0  # [s] for a writer to say what it wrote last; one that is frozen is gone after the lease of 1 s
RECONNECTION_TIMEOUT = 10.0  # [s] that a session may take to come back to a router that listens


class BusNotOpen(BusError):
    """The router did not take the session."""


class ZenohBus:
    """One node's session, and a second one where it serves urgent keys."""

    clock = SYSTEM

    def __init__(self, router: RouterSection, robot: str, pace: Pace | None = None) -> None:
        """Raises `BusNotOpen` where the router does not take the session; `pace` is that of its requests."""
        self._pace = pace or Pace()
        self._router, self._robot = router, robot
        self._watches: list[object] = []
        self._session = self._open()
        self._urgent_session: zenoh.Session | None = None
        self._common_name = _name_in(router.certificate) if router.tls else ""
        self._secret = secrets.token_hex(MAX_SECRET // 2)
        self._numbers = itertools.count(1)
        self._disconnected_since: float | None = None  # [s] monotonic
        self._recognition = Recognition(RECONNECTION_TIMEOUT)
        self._own_token = ""  # that the router is asked for
        self._tokens: list[ZenohDeclaration] = []
        self._queryables: list[ZenohQueryable] = []
        self._monitors: dict[str, ServerMonitor] = {}
        self._lock = threading.Lock()
        close_at_exit(self)

    @property
    def is_connected(self) -> bool:
        return all(session.info.routers_zid() for session in self._sessions)

    @property
    def router(self) -> str:
        return next(map(str, self._session.info.routers_zid()), "")

    @property
    def _sessions(self) -> list[zenoh.Session]:
        return [self._session] if self._urgent_session is None else [self._session, self._urgent_session]

    def _open(self) -> zenoh.Session:
        try:
            session = zenoh.open(client_config(self._router, self._robot))
        except zenoh.ZError as error:
            raise BusNotOpen(str(error)) from error
        self._watches.append(end_dead_links(session))
        return session

    @property
    def certificate(self) -> str:
        return self._router.certificate if self._router.tls else ""

    @property
    def common_name(self) -> str:
        return self._common_name

    def require_reconnection(self) -> None:
        now = time.monotonic()
        if self.is_connected:
            self._disconnected_since = None
            if self._own_token:
                self._recognition.ask(self._session, self._own_token)
            is_served = all(self.wait_served(each.key, 0.0) for each in self._queryables if each.is_urgent)
            if complaint := self._recognition.complaint(now, is_served):
                raise BusError(complaint)
            return
        self._recognition.begin_anew()
        if not router_answers(self._router.host, self._router.port, timeout=0.1):
            self._disconnected_since = None
            return
        self._disconnected_since = self._disconnected_since or now
        if now - self._disconnected_since > RECONNECTION_TIMEOUT:
            raise BusError(because("router.not_taken_back", time=RECONNECTION_TIMEOUT))

    def publish(
        self, key: str, schema: str, delivery: Delivery, writer: str = "", instance: str = ""
    ) -> ZenohPublication:
        encoding = encoding_of(schema)
        key = written_under(key, principal_of(writer, self._common_name), writer)
        if delivery is Delivery.LATEST:
            drop = zenoh.CongestionControl.DROP
            plain = self._session.declare_publisher(key, encoding=encoding, congestion_control=drop)
            return ZenohPublication(plain, writer, instance)
        latched = delivery is Delivery.LATCHED
        publisher = zx.declare_advanced_publisher(
            self._session,
            key,
            encoding=encoding,
            congestion_control=zenoh.CongestionControl.BLOCK,
            reliability=zenoh.Reliability.RELIABLE,
            cache=zx.CacheConfig(max_samples=1 if latched else CACHE_OF.get(schema, CACHE)),
            sample_miss_detection=zx.MissDetectionConfig(heartbeat=HEARTBEAT, sporadic_heartbeat=None),
            publisher_detection=latched,
        )
        return ZenohPublication(publisher, writer, instance)

    def subscribe(
        self,
        key: str,
        delivery: Delivery,
        on_arrival: Callable[[Arrival], None],
        on_miss: Callable[[int], None],
        own: bool = False,
    ) -> ZenohDeclaration:
        is_branched, read = is_of_many(key), read_under(key)

        def on_sample(sample: zenoh.Sample) -> None:
            signature = ((writer_at(str(sample.key_expr)) or ""), "") if is_branched else signature_in(sample)
            on_arrival(Arrival(key, schema_in(sample.encoding), bytes(sample.payload), *signature))

        origin = zenoh.Locality.ANY if own else zenoh.Locality.REMOTE
        if delivery is Delivery.LATEST:
            return ZenohDeclaration(self._session.declare_subscriber(read, on_sample, allowed_origin=origin))
        latched = delivery is Delivery.LATCHED
        said_before = {} if latched else self._newest(read)

        def on_news(sample: zenoh.Sample) -> None:
            # Recovery would hand a late joiner the writer's whole cache, which was never meant for it.
            source = sample.source_info
            if source is None or source.source_sn > said_before.get(_epoch(source), -1):
                on_sample(sample)

        subscriber = zx.declare_advanced_subscriber(
            self._session,
            read,
            on_sample if latched else on_news,
            allowed_origin=origin,
            history=zx.HistoryConfig(detect_late_publishers=True, max_samples=1) if latched else None,
            recovery=zx.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        misses = subscriber.sample_miss_listener(lambda miss: on_miss(0 if latched else miss.nb))
        return ZenohDeclaration(misses, subscriber)

    def _newest(self, key: str) -> dict[str, int]:
        """The sequence number of each writer's newest message of an EVERY key, by the writer's epoch.

        Asked of the writers' caches: their clocks say nothing, as those of two hosts differ.
        """
        replies = self._session.get(
            f"{key}/@adv/pub/**?_max=1",
            timeout=TO_ANSWER,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
        )
        sources = [reply.ok.source_info for reply in replies if reply.ok is not None]
        return {_epoch(source): source.source_sn for source in sources if source is not None}

    def serve(
        self, key: str, on_query: Callable[[Query], None], urgent: bool = False, is_first: IsFirst = never
    ) -> ZenohQueryable:
        if urgent and self._urgent_session is None:
            self._urgent_session = self._open()
        session = self._urgent_session if urgent and self._urgent_session else self._session
        queryable = ZenohQueryable(session, key, on_query, urgent, bool(self._common_name), is_first)
        self._queryables.append(queryable)
        return queryable

    def wait_served(self, key: str, timeout: float) -> bool:
        """True if a node serves `key`; waits up to `timeout` [s] for it."""
        with self._lock:
            monitor = self._monitors.get(key)
            if monitor is None:
                monitor = self._monitors[key] = ServerMonitor(self._session, self._asked_under(key))
        return monitor.wait(timeout)

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
        answers: list[BusReply] = []

        def on_reply(reply: zenoh.Reply) -> None:
            sample, error = reply.ok, reply.err
            if sample is not None:
                answers.append(BusReply(True, schema_in(sample.encoding), bytes(sample.payload)))
            elif error is not None and not is_timeout(error):
                answers.append(BusReply(False, schema_in(error.encoding), bytes(error.payload)))

        def on_end() -> None:
            # Zenoh ends a request that has timed out as one that was dropped: with or without an error of its own.
            nothing = UNREAD if time.monotonic() - asked < MOST_OF_A_TIMEOUT * timeout else None
            on_answer(answers[0] if answers else nothing)

        if not urgent:
            self._pace.wait_for_turn()
        asked = time.monotonic()
        self._session.get(
            self._asked_under(key),
            # Direct: else Zenoh starts a thread for each request, which costs ten times as much as the request itself.
            Callback(on_reply, on_end, indirect=False),
            payload=payload,
            encoding=encoding_of(schema),
            timeout=timeout,
            target=zenoh.QueryTarget.BEST_MATCHING,
            consolidation=zenoh.ConsolidationMode.NONE,
            priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.DATA,
            express=urgent,
            attachment=asked_by(self._secret, number),
        )

    def take_new_name(self) -> None:
        """Asks from now on as another client: what whoever floods under ever new names does."""
        self._secret = secrets.token_hex(MAX_SECRET // 2)

    def _asked_under(self, key: str) -> str:
        return asked_under(key, self._common_name or LOCAL)

    def declare_alive(self, key: str) -> ZenohDeclaration:
        token = ZenohDeclaration(self._session.liveliness().declare_token(key))
        self._own_token = key
        self._tokens.append(token)  # one that nobody holds would be undeclared
        return token

    def watch_alive(self, key: str, on_change: Callable[[bool], None]) -> ZenohDeclaration:
        def on_sample(sample: zenoh.Sample) -> None:
            if str(sample.key_expr) == key:  # a wildcard token stands for this one too, and says nothing of it
                on_change(sample.kind == zenoh.SampleKind.PUT)

        self._note_watch(key)
        return ZenohDeclaration(self._session.liveliness().declare_subscriber(key, on_sample, history=True))

    def watch_tokens(self, pattern: str, on_change: Callable[[str, bool], None]) -> ZenohDeclaration:
        def on_sample(sample: zenoh.Sample) -> None:
            on_change(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._note_watch(pattern)
        return ZenohDeclaration(self._session.liveliness().declare_subscriber(pattern, on_sample, history=True))

    def _note_watch(self, pattern: str) -> None:
        """Of tokens that a session watches it asks no router any more (Zenoh 1.10.2)."""
        if self._own_token and zenoh.KeyExpr(pattern).intersects(zenoh.KeyExpr(self._own_token)):
            self._own_token = ""
            self._recognition.begin_anew()

    def alive(self, pattern: str) -> set[str]:
        replies = self._session.liveliness().get(pattern, timeout=1.0)
        return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}

    def close(self) -> None:
        forget(self)
        closing = [threading.Thread(target=each.close, daemon=True, name="close") for each in self._sessions]
        for thread in closing:
            thread.start()
        end = time.monotonic() + CLOSE_TIMEOUT
        for thread in closing:
            thread.join(max(0.0, end - time.monotonic()))
        end = time.monotonic() + CLOSE_TIMEOUT
        for queryable in self._queryables:
            queryable.join(max(0.0, end - time.monotonic()))


def _epoch(source: zenoh.SourceInfo) -> str:
    """One declaration of a publisher: a process that starts anew has another, and counts from 0."""
    return str(source.source_id)


def router_answers(host: str, port: int, timeout: float = 0.5) -> bool:
    """True if a TCP connection to the router's address opens within `timeout` [s]."""
    try:
        socket.create_connection((host, port), timeout=timeout).close()
    except OSError:
        return False
    return True


def _name_in(certificate: str) -> str:
    """The common name that this host's file has; raises `AccessError`."""
    from gemelo.libraries.credentials.common_name import common_name  # where the router asks for certificates alone

    return common_name(Path(certificate))
