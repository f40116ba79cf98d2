"""The client side of a request: one question, one reply."""

from __future__ import annotations

from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

from gemelo.libraries.runtime.bus.interface import UNREAD, Arrival, Bus, BusReply
from gemelo.libraries.runtime.bus.wire import TooLarge, from_arrival, schema_of, to_payload
from gemelo.libraries.runtime.errors import TOO_LARGE, NoAnswer, RequestRefused
from gemelo.libraries.runtime.loop.task_queue import Task
from gemelo.libraries.runtime.requests.limits import DEBT, OF_A_CLIENT
from gemelo.schemas.message import BadMessage, Message
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.system import Failure
from gemelo.schemas.topics import Request

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

PAUSE = 0.05  # [s] until an urgent request is sent again; chosen: below what a server answers of one client
SERVER_APPEARANCE_TIMEOUT = 1.0  # [s] that a client waits for a server to appear


class PendingCall(Generic[Q, R]):
    """A request that was sent, and its reply.

    An urgent one that ends without a reply is sent again, with the same number, until its time is over: a link that
    broke on the way says nothing of the server, and repeating a stop does no harm.
    """

    def __init__(
        self,
        bus: Bus,
        request: Request[Q, R],
        question: Q,
        timeout: float,
        wake: Task,
        number: int = 0,
        appearance: float = SERVER_APPEARANCE_TIMEOUT,
    ) -> None:
        """Sends the request, with `timeout` [s] for its reply; `wake` is then called from another thread.

        Raises `RequestRefused` where the question is too large to be sent, and `NoAnswer` where no node serves the
        request within `appearance` [s]; with 0 it is sent in any case.
        """
        self._bus, self._request, self._wake = bus, request, wake
        self._timeout, self._tries = timeout, 0
        self._answers: SimpleQueue[BusReply | None] = SimpleQueue()
        self._payload, self._number = _payload_of(question), number or bus.take_number()
        if appearance and not bus.wait_served(request.key, min(timeout, appearance)):
            raise NoAnswer(_nobody(bus, request))
        self._end = bus.clock.monotonic() + timeout
        self._send()

    @property
    def is_over(self) -> bool:
        """True if `response` returns without blocking."""
        return not self._answers.empty()

    def response(self) -> R:
        """Blocks up to the time-out; raises `RequestRefused` or `NoAnswer`."""
        try:
            answer = self._bus.clock.take(self._answers, self._timeout + 1.0)
        except Empty:
            answer = None
        if answer is None:
            raise NoAnswer(_silent(self._bus, self._request, self._timeout))
        if answer == UNREAD:
            raise NoAnswer(_unread(self._bus, self._request, self._timeout, self._tries))
        return response_in(self._request, answer)

    def _send(self) -> None:
        self._tries += 1
        schema, left = schema_of(self._request.request), max(PAUSE, self._end - self._bus.clock.monotonic())
        urgent = self._request.urgent
        self._bus.ask(self._request.key, schema, self._payload, left, self._on_answer, urgent, self._number)

    def _send_again(self) -> None:
        try:
            self._send()
        except Exception:  # of a bus that was closed meanwhile, in whatever words
            self._put(UNREAD)

    def _on_answer(self, answer: BusReply | None) -> None:
        clock = self._bus.clock
        if answer == UNREAD and self._request.urgent and clock.monotonic() + PAUSE < self._end:
            clock.later(PAUSE, self._send_again)
        else:
            self._put(answer)

    def _put(self, answer: BusReply | None) -> None:
        self._answers.put(answer)
        self._wake()


def call(bus: Bus, request: Request[Q, R], question: Q, timeout: float, number: int = 0) -> R:
    """The answer; blocks up to `timeout` [s]. Raises `RequestRefused` or `NoAnswer`; `number` as that of `Bus.ask`."""
    return PendingCall(bus, request, question, timeout, lambda: None, number).response()


def _payload_of(question: Message) -> bytes:
    """What is too large to be sent is refused here as by its server: whoever asks handles one exception."""
    try:
        return to_payload(question)
    except TooLarge as error:
        raise RequestRefused(error.reason, TOO_LARGE) from error


def response_in(request: Request[Q, R], answer: BusReply) -> R:
    """The response in `answer`; raises `RequestRefused` for a failure, `NoAnswer` where it cannot be read."""
    try:
        arrival = Arrival(request.key, answer.schema, answer.payload)
        if answer.ok:
            return from_arrival(request.response, arrival)
        failure = from_arrival(Failure, arrival)
    except BadMessage as error:
        why = because("answer.unreadable", server=request.server, key=request.key, error=str(error))
        raise NoAnswer(why) from error
    raise RequestRefused(failure.why or failure.message, failure.kind)


def _silent(bus: Bus, request: Request[Q, R], timeout: float) -> Reason:
    """Why a reply is missing; a missing router is checked first, because it also hides the servers."""
    if not bus.is_connected:
        return _away(request)
    return because("answer.late", server=request.server, key=request.key, time=timeout)


def _unread(bus: Bus, request: Request[Q, R], timeout: float, tries: int) -> Reason:
    """Why a request ended without a reply: its server or a link has ended before, or it was dropped."""
    if not bus.is_connected:
        return _away(request)
    rate, pause = OF_A_CLIENT.per_second, DEBT / OF_A_CLIENT.per_second
    server, key = request.server, request.key
    if not request.urgent:
        return because("answer.dropped", server=server, key=key, rate=rate, pause=pause)
    if not bus.wait_served(key, 0.0):
        return because("answer.urgent.gone", server=server, key=key, time=timeout, tries=tries)
    return because("answer.urgent.dropped", server=server, key=key, time=timeout, tries=tries, rate=rate, pause=pause)


def _away(request: Request[Q, R]) -> Reason:
    return because("answer.no_router", key=request.key)


def _nobody(bus: Bus, request: Request[Q, R]) -> Reason:
    if not bus.is_connected:
        return _away(request)
    if bus.certificate:
        return because("answer.nobody.role", key=request.key, certificate=bus.certificate, server=request.server)
    return because("answer.nobody", key=request.key, server=request.server)
