"""Requests: a question with one answer, in the thread of logic or in the node's worker."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

from schemas.message import BadMessage, Message
from schemas.system import Failure, TopicStatistics
from schemas.topics import Request
from services.runtime.bus import Answer, Arrival, Bus, Query
from services.runtime.errors import NoAnswer, Refused
from services.runtime.inbox import Task
from services.runtime.topics import Complain
from services.runtime.wire import from_arrival, schema_of, to_payload

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

MOST_WAITING = 64  # requests in the inbox of one server; more are refused
PRESENCE_PATIENCE = 1.0  # [s] that a client waits for a server to appear


class Pending(Generic[R]):
    """A request that has not been answered yet."""

    def __init__(self, query: Query) -> None:
        self._query = query
        self.is_answered = False

    def reply(self, response: R) -> None:
        """Only the first answer counts."""
        payload = to_payload(response)
        if not self.is_answered:
            self.is_answered = True
            self._query.reply(schema_of(type(response)), payload)

    def refuse(self, kind: str, message: str) -> None:
        """As `reply`, with why not."""
        if not self.is_answered:
            self.is_answered = True
            self._query.fail(schema_of(Failure), to_payload(Failure(kind=kind, message=message)))


class Server(Generic[Q, R]):
    """Answers one request; `handler` may keep the `Pending` and answer later."""

    def __init__(
        self,
        bus: Bus,
        put: Callable[[Task], None],
        request: Request[Q, R],
        handler: Callable[[Q, Pending[R]], None],
        complain: Complain,
    ) -> None:
        self.request = request
        self._put, self._handler, self._complain = put, handler, complain
        self._received, self._refused, self._bad = 0, 0, 0
        self._places = threading.BoundedSemaphore(MOST_WAITING)
        self._declaration = bus.serve(request.key, self._on_query)

    @property
    def statistics(self) -> TopicStatistics:
        return TopicStatistics(key=self.request.key, received=self._received, dropped=self._refused, bad=self._bad)

    def close(self) -> None:
        self._declaration.close()

    def _on_query(self, query: Query) -> None:
        if not self._places.acquire(blocking=False):
            self._refused += 1
            Pending[R](query).refuse("busy", f"{self.request.key}: {MOST_WAITING} requests are waiting already")
            return
        self._put(lambda: self._handle(query))

    def _handle(self, query: Query) -> None:
        self._places.release()
        pending: Pending[R] = Pending(query)
        try:
            question = from_arrival(self.request.request, query.arrival)
        except BadMessage as error:
            self._bad += 1
            if self._bad == 1:
                self._complain(f"{self.request.key}: refused a bad request: {error} (further ones are only counted)")
            pending.refuse("bad request", str(error))
            return
        self._received += 1
        try:
            self._handler(question, pending)
        except Refused as error:
            pending.refuse(error.kind, str(error))
        except Exception as error:
            self._complain(f"{self.request.key}: {traceback.format_exc()}")
            pending.refuse("internal error", f"{self.request.server} failed: {type(error).__name__}: {error}")


class Asked(Generic[Q, R]):
    """A question that was sent, and its answer when it comes."""

    def __init__(self, bus: Bus, request: Request[Q, R], question: Q, timeout: float, wake: Task) -> None:
        """`wake` is called when it comes, from another thread; raises `NoAnswer` where nobody serves the request."""
        self._bus, self._request, self._wake = bus, request, wake
        self._patience = timeout
        self._answers: SimpleQueue[Answer | None] = SimpleQueue()
        payload = to_payload(question)
        if not bus.wait_served(request.key, min(timeout, PRESENCE_PATIENCE)):
            raise NoAnswer(_nobody(bus, request))
        bus.ask(request.key, schema_of(request.request), payload, timeout, self._on_answer)

    @property
    def is_over(self) -> bool:
        """Whether `response` would not block."""
        return not self._answers.empty()

    def response(self) -> R:
        """Blocks up to the time-out; raises `Refused` or `NoAnswer`."""
        try:
            answer = self._answers.get(timeout=self._patience + 1.0)
        except Empty:
            answer = None
        if answer is None:
            raise NoAnswer(_silent(self._bus, self._request, self._patience))
        return response_in(self._request, answer)

    def _on_answer(self, answer: Answer | None) -> None:
        self._answers.put(answer)
        self._wake()


def call(bus: Bus, request: Request[Q, R], question: Q, timeout: float) -> R:
    """The answer; blocks up to `timeout` [s]. Raises `Refused` or `NoAnswer`."""
    return Asked(bus, request, question, timeout, wake=lambda: None).response()


def response_in(request: Request[Q, R], answer: Answer) -> R:
    """The response in `answer`; raises `Refused` for a failure, `NoAnswer` where it cannot be read."""
    try:
        arrival = Arrival(request.key, answer.schema, answer.payload)
        if answer.ok:
            return from_arrival(request.response, arrival)
        failure = from_arrival(Failure, arrival)
    except BadMessage as error:
        raise NoAnswer(f"the answer of {request.server} to {request.key} cannot be read: {error}") from error
    raise Refused(failure.message, failure.kind)


def _silent(bus: Bus, request: Request[Q, R], timeout: float) -> str:
    """Who is known to serve may be forgotten a moment after the router has gone: so its absence is looked for first."""
    if not bus.is_connected:
        return _away(request)
    return f"{request.server} did not answer {request.key} within {timeout:g} s: is it busy, or gone?"


def _away(request: Request[Q, R]) -> str:
    return f"{request.key}: the router is away; start it with `make up`"


def _nobody(bus: Bus, request: Request[Q, R]) -> str:
    if not bus.is_connected:
        return _away(request)
    return f"nobody serves {request.key}: is {request.server} running? `gemelo node list` shows who is"
