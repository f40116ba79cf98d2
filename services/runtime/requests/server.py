"""The server side of a request: limits per client, and priority for urgent requests."""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from schemas.message import BadMessage, Message
from schemas.system import Failure, TopicStatistics
from schemas.topics import Request
from services.runtime.bus.interface import Bus, Query
from services.runtime.bus.wire import from_arrival, schema_of, to_payload
from services.runtime.errors import Refused
from services.runtime.loop.task_queue import Task
from services.runtime.topics import Warn

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
R_contra = TypeVar("R_contra", bound=Message, contravariant=True)

# Chosen: a script waits for its answers, so few clients ever have more than one request here.
MAX_WAITING_OF_A_CLIENT = 64  # requests of one client that wait in one server; more are refused
MAX_WAITING = 1024  # requests of all clients that wait in one server; more are refused
MAX_UNANSWERED = 1024  # callers of one urgent server that are answered together; the rest hears so at once


class Pending(Protocol[R_contra]):
    """A request, or several equal ones, that wait for their answer."""

    def reply(self, response: R_contra) -> None:
        """Only the first answer counts; from any thread."""

    def refuse(self, kind: str, message: str) -> None:
        """As `reply`, with why not."""


class PendingQuery(Generic[R]):
    """One request."""

    def __init__(self, query: Query) -> None:
        self._query = query
        self._is_answered = False

    def reply(self, response: R) -> None:
        payload = to_payload(response)
        if not self._is_answered:
            self._is_answered = True
            self._query.reply(schema_of(type(response)), payload)

    def refuse(self, kind: str, message: str) -> None:
        if not self._is_answered:
            self._is_answered = True
            self._query.fail(schema_of(Failure), to_payload(Failure(kind=kind, message=message)))


class PendingGroup(Generic[R]):
    """Equal requests of any number of callers, answered together."""

    def __init__(self, on_answered: Callable[[int], None]) -> None:
        self._queries: list[PendingQuery[R]] = []
        self._on_answered = on_answered

    def join(self, query: Query) -> None:
        self._queries.append(PendingQuery(query))

    def reply(self, response: R) -> None:
        for query in self._take():
            query.reply(response)

    def refuse(self, kind: str, message: str) -> None:
        for query in self._take():
            query.refuse(kind, message)

    def _take(self) -> list[PendingQuery[R]]:
        queries, self._queries = self._queries, []
        self._on_answered(len(queries))
        return queries


class WaitingRequests:
    """Counts the waiting requests per client and limits them, so that one client cannot block the others."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._of: Counter[str] = Counter()
        self._lock = threading.Lock()

    def refusal(self, client: str) -> str:
        """Counts one more request of `client`; returns the reason if its limit is reached, else an empty text."""
        with self._lock:
            if self._of[client] >= MAX_WAITING_OF_A_CLIENT:
                return f"{self._key}: {MAX_WAITING_OF_A_CLIENT} requests are waiting already, all of this client"
            if self._of.total() >= MAX_WAITING:
                return f"{self._key}: {MAX_WAITING} requests are waiting already"
            self._of[client] += 1
            return ""

    def leave(self, client: str) -> None:
        with self._lock:
            self._of[client] -= 1
            if self._of[client] <= 0:
                del self._of[client]


class RequestServer(Generic[Q, R]):
    """Answers the requests of one key in order; `handler` may keep the `Pending` and answer later."""

    def __init__(
        self,
        bus: Bus,
        put: Callable[[Task], None],
        request: Request[Q, R],
        handler: Callable[[Q, Pending[R]], None],
        warn: Warn,
    ) -> None:
        self.request = request
        self._put = put
        self._handler, self._warn = handler, warn
        self._received, self._refused, self._bad = 0, 0, 0
        self._waiting = WaitingRequests(request.key)
        self._void_before, self._void_reason = -math.inf, ""  # [s] monotonic
        self._declaration = bus.serve(request.key, self._on_query)

    @property
    def statistics(self) -> TopicStatistics:
        return TopicStatistics(key=self.request.key, received=self._received, dropped=self._refused, bad=self._bad)

    def close(self) -> None:
        self._declaration.close()

    def refuse_waiting(self, reason: str) -> None:
        """Refuses the requests that have arrived but are not handled yet, because an urgent request made them void."""
        self._void_before, self._void_reason = time.monotonic(), reason

    def _on_query(self, query: Query) -> None:
        if refusal := self._waiting.refusal(query.client):
            self._refused += 1
            PendingQuery[R](query).refuse("busy", refusal)
            return
        arrived = time.monotonic()
        self._put(lambda: self._take(query, arrived))

    def _take(self, query: Query, arrived: float) -> None:
        self._waiting.leave(query.client)
        pending = PendingQuery[R](query)
        if arrived <= self._void_before:
            return pending.refuse("void", f"{self.request.key}: {self._void_reason}")
        question = self._question(query, pending)
        if question is not None:
            self._received += 1
            self._handle(question, pending)

    def _question(self, query: Query, pending: PendingQuery[R]) -> Q | None:
        """The decoded question; None where it cannot be decoded, after a refusal was sent."""
        try:
            return from_arrival(self.request.request, query.arrival)
        except BadMessage as error:
            self._bad += 1
            if self._bad == 1:
                self._warn(f"{self.request.key}: refused a bad request: {error} (further ones are only counted)")
            pending.refuse("bad request", str(error))
            return None

    def _handle(self, question: Q, pending: Pending[R]) -> None:
        try:
            self._handler(question, pending)
        except Refused as error:
            pending.refuse(error.kind, str(error))
        except Exception as error:
            self._warn(f"{self.request.key}: {traceback.format_exc()}")
            pending.refuse("internal error", f"{self.request.server} failed: {type(error).__name__}: {error}")


class UrgentServer(RequestServer[Q, R]):
    """Answers the requests of one key before everything else that waits in the node.

    Requests are read where they arrive, and equal ones that wait are handled once, for all their callers: repeating
    one costs nothing.
    """

    def __init__(
        self,
        bus: Bus,
        put: Callable[[Task], None],
        request: Request[Q, R],
        handler: Callable[[Q, Pending[R]], None],
        warn: Warn,
    ) -> None:
        self._groups: dict[Q, PendingGroup[R]] = {}
        self._unanswered = 0
        self._lock = threading.Lock()
        super().__init__(bus, put, request, handler, warn)

    def _on_query(self, query: Query) -> None:
        question = self._question(query, PendingQuery[R](query))
        if question is None:
            return
        refusal = self._join(question, query)
        if refusal:
            self._refused += 1
            PendingQuery[R](query).refuse("busy", refusal)

    def _join(self, question: Q, query: Query) -> str:
        """Queues `question`; returns the reason where its caller cannot be answered with the others."""
        with self._lock:
            group = self._groups.get(question)
            if group is None:
                if refusal := self._waiting.refusal(query.client):
                    return refusal
                group = self._groups[question] = PendingGroup(self._answered)
                self._put(lambda: self._take_group(question, query.client))
            self._received += 1
            if self._unanswered >= MAX_UNANSWERED:
                return f"{self.request.key}: taken; {MAX_UNANSWERED} callers wait for its answer already"
            self._unanswered += 1
            group.join(query)
            return ""

    def _take_group(self, question: Q, client: str) -> None:
        self._waiting.leave(client)
        with self._lock:
            group = self._groups.pop(question)
        self._handle(question, group)

    def _answered(self, count: int) -> None:
        with self._lock:
            self._unanswered -= count
