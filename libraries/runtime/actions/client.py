"""The client side of an action: send, feedback, cancel, and a result in bounded time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import msgspec

from gemelo.libraries.runtime.actions import keys as keys
from gemelo.libraries.runtime.actions.goal_handle import GoalHandle
from gemelo.libraries.runtime.bus.interface import Bus
from gemelo.libraries.runtime.clock import token
from gemelo.libraries.runtime.errors import GoalRefused, NoAnswer
from gemelo.libraries.runtime.loop.loop import Loop
from gemelo.libraries.runtime.requests import client as requests
from gemelo.schemas.actions import CancelRequest, GoalFeedback, GoalRequest, GoalStatuses, ResultRequest
from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.topics import Action, Request, Topic

G = TypeVar("G", bound=Message)
F = TypeVar("F", bound=Message)
R = TypeVar("R", bound=Message)
Q = TypeVar("Q", bound=Message)
A = TypeVar("A", bound=Message)

PAUSE = 0.05  # [s] between two tries
PACE = 2e6  # [bytes/s] at which a goal is sent, read and looked at, at the least; chosen: a busy small computer
ATTEMPT = 1.0  # [s] of one try to send a goal; further tries carry the same id, so it is accepted once


class ActionClient(Generic[G, F, R]):
    """Sends goals of one action; any number may be under way."""

    TICK = 0.1  # [s]

    def __init__(
        self,
        action: Action[G, F, R],
        bus: Bus,
        loop: Loop,
        subscribe: Callable[[Topic[Any], Callable[[Any], None]], object],
        client: str,
    ) -> None:
        self.action = action
        self._bus, self._loop, self._client = bus, loop, client
        self._handles: dict[str, GoalHandle[F, R]] = {}
        self._ticked = bus.clock.monotonic()
        subscribe(keys.feedback_topic(action), self._on_feedback)
        subscribe(keys.status_topic(action), self._on_status)

    def send(
        self,
        goal: G,
        on_feedback: Callable[[F], object] | None = None,
        timeout: float = 2.0,
        attached: bool = False,
        goal_id: str = "",
    ) -> GoalHandle[F, R]:
        """Sends a goal, blocks up to `timeout` [s] for the decision, and longer for a large one.

        Raises `GoalRefused`, `Refused`, `NoAnswer`.

        An `attached` goal is cancelled by the server when this node disappears, by its end or by the network's. Without
        `goal_id` one is drawn.
        """
        goal_id, raw = goal_id or token(self._bus.clock), _raw(goal)
        more = len(bytes(raw)) / PACE
        handle: GoalHandle[F, R] = GoalHandle(self.action, goal_id, self._bus, self._loop, on_feedback)
        self._handles[goal_id] = handle
        end, number = (
            self._bus.clock.monotonic() + timeout + more,
            self._bus.take_number(),
        )  # one for all: no try overtakes a stop
        try:
            epoch = self._ask(keys.result_request(self.action), ResultRequest(), end).epoch
            request = GoalRequest(
                goal_id=goal_id, client=self._client, goal=raw, attached=attached, epoch=epoch
            )  # fmt: skip
            response = self._ask(keys.goal_request(self.action), request, end, number, ATTEMPT + more)
        except (NoAnswer, KeyboardInterrupt):
            handle.cancel()  # it may have been accepted all the same
            del self._handles[goal_id]
            raise
        except BaseException:
            del self._handles[goal_id]
            raise
        if not response.accepted:
            del self._handles[goal_id]
            raise GoalRefused(response.code, response.reason, response.why)
        handle.accepted_at(response.stamp)
        return handle

    def cancel_all(self, timeout: float = 2.0) -> tuple[str, ...]:
        """Cancels all goals of all clients; returns the ids of those being cancelled. Blocks up to `timeout` [s]."""
        return requests.call(self._bus, keys.cancel_request(self.action), CancelRequest(), timeout).canceling

    def tick(self) -> None:
        """Checks that the server is alive; a pause of this process itself does not count."""
        now = self._bus.clock.monotonic()
        slept = now - self._ticked > 5 * self.TICK
        self._ticked = now
        for handle in list(self._handles.values()):
            if slept:
                handle.heard()
            handle.tick(now)
            if handle.is_over:
                del self._handles[handle.goal_id]

    def _ask(self, request: Request[Q, A], question: Q, end: float, number: int = 0, attempt: float = ATTEMPT) -> A:
        """Asks until it is answered, `attempt` [s] each time; raises `NoAnswer` after `end` [s] monotonic.

        That is of the try that had most time: the last one may end before anything can come back. `number` as that of
        `Bus.ask`.
        """
        most, why = 0.0, NoAnswer("")
        while True:
            left = max(0.05, min(attempt, end - self._bus.clock.monotonic()))
            try:
                return requests.call(self._bus, request, question, left, number)
            except NoAnswer as error:
                if left >= most:
                    most, why = left, error
                if self._bus.clock.monotonic() >= end - PAUSE:
                    raise why from None
                self._bus.clock.sleep(PAUSE)  # the answer that none will come is there at once

    def _on_feedback(self, message: GoalFeedback) -> None:
        handle = self._handles.get(message.goal_id)
        if handle is None:
            return
        try:
            handle.on_feedback(decode(self.action.feedback, bytes(message.feedback)))
        except BadMessage:
            handle.bad_feedback += 1

    def _on_status(self, message: GoalStatuses) -> None:
        for handle in list(self._handles.values()):
            handle.on_status(message)


def _raw(message: Message) -> msgspec.Raw:
    return msgspec.Raw(encode(message))
