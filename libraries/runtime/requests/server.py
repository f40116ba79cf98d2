"""The server side of a request: limits per client, and priority for urgent requests."""

from __future__ import annotations

import math
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar

import msgspec

from gemelo.libraries.runtime.bus.interface import Arrival, Bus, Query, never
from gemelo.libraries.runtime.bus.wire import Encoded, TooLarge, encoded, from_arrival, schema_of, to_payload
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.errors import TOO_LARGE, RequestRefused
from gemelo.libraries.runtime.loop.task_queue import Task, TaskQueue
from gemelo.libraries.runtime.requests.limits import OF_A_CLIENT, RequestRates, WaitingRequests
from gemelo.libraries.runtime.requests.overtaken import OvertakenRequests
from gemelo.libraries.runtime.topics import Warn
from gemelo.schemas.actions import NIL
from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.reasons import PLAIN, Reason, because
from gemelo.schemas.system import Exchange, Failure, TopicStatistics
from gemelo.schemas.topics import Request

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
R_contra = TypeVar("R_contra", bound=Message, contravariant=True)

MAX_UNANSWERED = 1024  # callers of one urgent server that are answered together; the rest hears so at once
REPEAT = 0.01  # [s] chosen: in a flood of stops the gateway is free for other work between two of them
MAX_TAKEN = 64  # questions whose last time is kept
MAX_TOLD = 64  # callers that are named with an answer
MAX_ASKERS = 256  # callers of one urgent request whose numbers are kept
MAX_REASON = 4000  # characters of a refusal; chosen: a person reads no more, and what is echoed in it has no end

Tell = Callable[[Exchange], None]


def shortened(reason: str) -> str:
    """The reason, without its middle where it is longer than anybody reads."""
    half = MAX_REASON // 2
    return reason if len(reason) <= MAX_REASON else f"{reason[:half]} ... {reason[-half:]}"


def failure_of(kind: str, message: Reason | str) -> Failure:
    """A refusal as it is sent."""
    why = message if isinstance(message, Reason) and message.code != PLAIN else None
    return Failure(kind=kind, message=shortened(str(message)), why=why)


class AnswerReport:
    """Publishes a question with its answer, after who asked has got it: nothing waits for a recording."""

    def __init__(self, tell: Tell, question: bytes, arrived: float, clock: Clock = SYSTEM) -> None:
        """`question` as it came, and readable; it `arrived` at [s] monotonic."""
        self._tell, self._question, self._arrived, self._clock = tell, question, arrived, clock

    def answered(self, clients: tuple[str, ...], answer: bytes) -> None:
        self._put(clients, msgspec.Raw(answer), None)

    def refused(self, clients: tuple[str, ...], failure: Failure) -> None:
        self._put(clients, NIL, failure)

    def _put(self, clients: tuple[str, ...], answer: msgspec.Raw, failure: Failure | None) -> None:
        self._tell(
            Exchange(
                stamp=self._clock.unix(),
                duration=self._clock.monotonic() - self._arrived,
                clients=clients[:MAX_TOLD],
                question=msgspec.Raw(self._question),
                answer=answer,
                failure=failure,
            )
        )


class Pending(Protocol[R_contra]):
    """A request, or several equal ones, that wait for their answer."""

    @property
    def client(self) -> str:
        """The session that asks, as it says itself; of several the first."""
        ...

    @property
    def asked(self) -> dict[str, int]:
        """Of each session that asks the number of its newest request."""
        ...

    def reply(self, response: R_contra) -> None:
        """Only the first answer counts; from any thread. One that is too large to be sent becomes a refusal."""

    def send(self, response: Encoded[Any]) -> None:
        """As `reply`, with what is encoded already."""

    def refuse(self, kind: str, message: Reason | str) -> None:
        """As `reply`, with why not."""


class PendingQuery(Generic[R]):
    """One request."""

    def __init__(self, query: Query, report: AnswerReport | None = None) -> None:
        self._query, self._report = query, report
        self.client = query.client
        self.asked = {query.client: query.number}
        self._is_answered = False

    def reply(self, response: R) -> None:
        try:
            self.send(encoded(response))
        except TooLarge as error:
            self.refuse(TOO_LARGE, error.reason)

    def send(self, response: Encoded[R]) -> None:
        """As `reply`, with what is encoded already."""
        if not self._is_answered:
            self._is_answered = True
            self._query.reply(schema_of(type(response.message)), response.payload)
            if self._report is not None:
                self._report.answered((self.client,), response.payload)

    def refuse(self, kind: str, message: Reason | str) -> None:
        if not self._is_answered:
            self._is_answered = True
            failure = failure_of(kind, message)
            self._query.fail(schema_of(Failure), to_payload(failure))
            if self._report is not None:
                self._report.refused((self.client,), failure)


class PendingGroup(Generic[R]):
    """Equal requests of any number of callers, answered together."""

    def __init__(self, first: Query, on_answered: Callable[[int], None], report: AnswerReport | None) -> None:
        self.client, self.principal, self.size = first.client, first.principal, first.size
        self._report = report
        self.is_queued = False  # for the event loop
        self.is_new = True  # no timer will queue it
        self._queries: list[PendingQuery[R]] = []
        self.asked: dict[str, int] = {}  # also of those that get no answer
        self._on_answered = on_answered

    def note(self, query: Query, is_answered: bool) -> None:
        """It asks for the same; those that are above their rate leave room for the others."""
        most = MAX_ASKERS if is_answered else MAX_ASKERS // 2
        if len(self.asked) < most or query.client in self.asked:
            self.asked[query.client] = max(query.number, self.asked.get(query.client, 0))

    def join(self, query: Query) -> None:
        """It is answered with the others."""
        self._queries.append(PendingQuery(query))

    def reply(self, response: R) -> None:
        try:
            self.send(encoded(response))
        except TooLarge as error:
            self.refuse(TOO_LARGE, error.reason)

    def send(self, response: Encoded[R]) -> None:
        """As `reply`, with what is encoded already."""
        for query in self._take():
            query.send(response)
        if report := self._take_report():
            report.answered(self._clients(), response.payload)

    def refuse(self, kind: str, message: Reason | str) -> None:
        for query in self._take():
            query.refuse(kind, message)
        if report := self._take_report():
            report.refused(self._clients(), failure_of(kind, message))

    def _take(self) -> list[PendingQuery[R]]:
        queries, self._queries = self._queries, []
        self._on_answered(len(queries))
        return queries

    def _take_report(self) -> AnswerReport | None:
        """Once: only the first answer counts."""
        report, self._report = self._report, None
        return report

    def _clients(self) -> tuple[str, ...]:
        """Who asked, each once; also whose question was carried out without an answer."""
        return tuple(self.asked)


class RequestServer(Generic[Q, R]):
    """Answers the requests of one key in order; `handler` may keep the `Pending` and answer later."""

    def __init__(
        self,
        bus: Bus,
        put: Callable[[Task], None],
        request: Request[Q, R],
        handler: Callable[[Q, Pending[R]], None],
        warn: Warn,
        rates: RequestRates,
        tell: Tell | None = None,
    ) -> None:
        """`rates` are those of the node, which all its servers share; `tell` is told every question and answer."""
        self.request = request
        self._clock = bus.clock
        self._put, self._tell = put, tell
        self._handler, self._warn, self._rates = handler, warn, rates
        self._received, self._refused, self._dropped, self._bad = 0, 0, 0, 0
        self._waiting = WaitingRequests(request.key)
        self._overtaken = OvertakenRequests(request.key)
        is_first = never if request.first is None else self._is_first
        self._declaration = bus.serve(request.key, self._on_query, request.urgent, is_first)

    @property
    def statistics(self) -> TopicStatistics:
        dropped = self._refused + self._dropped
        return TopicStatistics(key=self.request.key, received=self._received, dropped=dropped, bad=self._bad)

    def close(self) -> None:
        self._declaration.close()

    def refuse_waiting(self, reason: Reason, asked: Mapping[str, int]) -> None:
        """Refuses the requests that were asked for before an urgent one that is handled now and made them void.

        Those are what has arrived, and what the clients in `asked` (see `Pending.asked`) have asked for before.
        """
        self._overtaken.stop(reason, asked, self._clock.monotonic())

    def _is_first(self, payload: bytes) -> bool:
        """True if this question is read before all others of its key."""
        try:
            return decode(self.request.request, payload) == self.request.first
        except BadMessage:
            return False

    def _on_query(self, query: Query) -> None:
        """Nothing of a request is read before its client may ask at all."""
        if not self._rates.permit_request(query.principal, query.client):
            self._drop(query)
        elif refusal := self._waiting.refusal(query.principal, query.client, query.size):
            self._refuse(query, refusal)
        else:
            arrived = self._clock.monotonic()
            self._put(lambda: self._take(query, arrived))

    def _drop(self, query: Query) -> None:
        query.drop()
        self._dropped += 1
        if self._dropped == 1:
            most = f"more than {OF_A_CLIENT.per_second:g} requests a second to this node"
            said = "nothing of it is read until it asks for less (further ones are only counted)"
            whose = f"of one client, or of newcomers ({query.principal})"
            self._warn(f"{self.request.key}: {most} {whose}: {said}")

    def _refuse(self, query: Query, reason: Reason) -> None:
        self._refused += 1
        if self._rates.permit_refusal():
            PendingQuery[R](query).refuse("busy", reason)
        else:
            query.drop()

    def _take(self, query: Query, arrived: float) -> None:
        self._waiting.leave(query.principal, query.client, query.size)
        question = self._question(query)
        if question is None:
            return
        pending = PendingQuery[R](query, self._report(query.arrival.payload, arrived))
        if void := self._overtaken.refusal(query.client, query.number, arrived):
            pending.refuse("void", void)
        else:
            self._received += 1
            self._handle(question, pending)

    def _report(self, question: bytes, arrived: float) -> AnswerReport | None:
        return AnswerReport(self._tell, question, arrived, self._clock) if self._tell is not None else None

    def _question(self, query: Query) -> Q | None:
        """The decoded question; None where it cannot be decoded, after a refusal was sent."""
        try:
            return from_arrival(self.request.request, query.arrival)
        except BadMessage as error:
            self._bad += 1
            if self._bad == 1:
                self._warn(f"{self.request.key}: refused a bad request: {error} (further ones are only counted)")
            PendingQuery[R](query).refuse("bad request", str(error))
            return None

    def _handle(self, question: Q, pending: Pending[R]) -> None:
        with self.failures_refused(pending):
            self._handler(question, pending)

    @contextmanager
    def failures_refused(self, pending: Pending[R]) -> Iterator[None]:
        """What is raised within becomes the refusal of that request, also where it is answered later."""
        try:
            yield
        except RequestRefused as error:
            pending.refuse(error.kind, error.reason)
        except Exception as error:
            self._warn(f"{self.request.key}: {traceback.format_exc()}")
            pending.refuse("internal error", f"{self.request.server} failed: {type(error).__name__}: {error}")


class UrgentServer(RequestServer[Q, R]):
    """Answers the requests of one key before everything else that waits in the node, and `Request.first` before them.

    Requests are read where they arrive, and equal ones that wait are handled once, for all their callers: repeating
    one costs nothing. All are carried out. What a client asks above its rate gets no answer, and is carried out up to
    REPEAT later where it repeats what has just been carried out.
    """

    def __init__(
        self,
        bus: Bus,
        tasks: TaskQueue,
        request: Request[Q, R],
        handler: Callable[[Q, Pending[R]], None],
        warn: Warn,
        rates: RequestRates,
        tell: Tell | None = None,
    ) -> None:
        self._tasks = tasks
        self._groups: dict[Q, PendingGroup[R]] = {}
        self._unanswered = 0
        self._taken: dict[Q, float] = {}  # [s] monotonic, when it was handled last
        self._last: tuple[Arrival, Q] | None = None  # a request that repeats it need not be decoded again
        self._lock = threading.Lock()
        super().__init__(bus, tasks.put_first, request, handler, warn, rates, tell)

    def _on_query(self, query: Query) -> None:
        arrival = query.arrival
        question = self._last[1] if self._last and self._last[0] == arrival else self._question(query)
        if question is None:
            return
        self._last = (arrival, question)
        is_answered = self._rates.permit_request(query.principal, query.client, urgent=True)
        if refusal := self._join(question, query, is_answered):
            self._refuse(query, refusal)
        elif not is_answered:
            self._drop(query)

    def _join(self, question: Q, query: Query, is_answered: bool) -> Reason | None:
        """Queues `question`; returns the reason where its caller cannot be answered with the others."""
        with self._lock:
            group = self._groups.get(question)
            if group is None:
                if refusal := self._waiting.refusal(query.principal, query.client, query.size):
                    return refusal
                report = self._report(encode(question), self._clock.monotonic())
                group = self._groups[question] = PendingGroup(query, self._answered, report)
            group.note(query, is_answered)
            self._queue(question, group, is_answered)
            self._received += 1
            if not is_answered:
                return None
            if self._unanswered >= MAX_UNANSWERED:
                return because("waiting.answer", key=self.request.key, count=MAX_UNANSWERED)
            self._unanswered += 1
            group.join(query)
            return None

    def _queue(self, question: Q, group: PendingGroup[R], is_at_once: bool) -> None:
        """Has the group handled, once; call with the lock."""
        if group.is_queued:
            return
        is_repeated = self._clock.monotonic() - self._taken.get(question, -math.inf) < REPEAT
        if is_at_once or not is_repeated:
            group.is_queued = True
            put = self._tasks.put_before_all if question == self.request.first else self._tasks.put_first
            put(lambda: self._take_group(question))
        elif group.is_new:
            group.is_new = False
            self._clock.later(REPEAT, lambda: self._queue_late(question, group))

    def _queue_late(self, question: Q, group: PendingGroup[R]) -> None:
        with self._lock:
            self._queue(question, group, True)

    def _take_group(self, question: Q) -> None:
        with self._lock:
            group = self._groups.pop(question)
            self._waiting.leave(group.principal, group.client, group.size)
            if len(self._taken) >= MAX_TAKEN:
                self._taken.clear()
            self._taken[question] = self._clock.monotonic()
        self._handle(question, group)

    def _answered(self, count: int) -> None:
        with self._lock:
            self._unanswered -= count
