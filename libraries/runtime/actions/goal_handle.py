"""One goal that a server has accepted, seen from its client."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Generic, TypeVar

from gemelo.libraries.runtime.actions import keys as keys
from gemelo.libraries.runtime.bus.interface import Bus, BusReply
from gemelo.libraries.runtime.bus.wire import schema_of
from gemelo.libraries.runtime.errors import NoAnswer, ServerLost
from gemelo.libraries.runtime.loop.loop import Loop
from gemelo.libraries.runtime.loop.task_queue import Task
from gemelo.schemas.actions import (
    CancelRequest,
    CancelResponse,
    GoalStatusCode,
    GoalStatuses,
    ResultRequest,
    ResultResponse,
)
from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import Action, Request

F = TypeVar("F", bound=Message)
R = TypeVar("R", bound=Message)
AnyRequest = Request[Message, Message]

SERVER_TIMEOUT = 2.0  # [s] of silence of a server that sends four signs of life a second
ROUTER_TIMEOUT = 10.0  # [s] that a router may be away before a goal counts as lost
ASK_TIMEOUT = 1.0  # [s]


@dataclass(frozen=True)
class ActionOutcome(Generic[R]):
    """The final status and result of a goal."""

    status: GoalStatusCode
    result: R


class GoalHandle(Generic[F, R]):
    """Feedback, status and result arrive in the thread of logic: while the node spins, or in `wait`."""

    def __init__(
        self,
        action: Action[Message, F, R],
        goal_id: str,
        bus: Bus,
        loop: Loop,
        on_feedback: Callable[[F], object] | None,
    ) -> None:
        self.action = action
        self.goal_id = goal_id
        self.status = GoalStatusCode.ACCEPTED
        self.feedback: F | None = None  # the newest
        self.outcome: ActionOutcome[R] | None = None
        self.bad_feedback = 0
        self._bus, self._loop, self._on_feedback = bus, loop, on_feedback
        self.lost: ServerLost | None = None  # why there will be no outcome
        self._accepted = 0  # [ns] UNIX of the server
        self._heard = bus.clock.monotonic()
        self._away: float | None = None  # [s] monotonic since when there is no router
        self._is_asking = False  # for the result
        self._wants_cancel = False
        self._is_canceling = False  # the request is under way
        self.cancel_refused = ""  # why the server goes on
        self.on_end: Task | None = None  # called in the thread of logic when it is over

    @property
    def is_over(self) -> bool:
        """True if the result has arrived or the server is lost."""
        return self.outcome is not None or self.lost is not None

    @property
    def accepted(self) -> int:
        """[ns] UNIX time of the server's decision."""
        return self._accepted

    def wait(self, timeout: float, on_tick: Task | None = None) -> ActionOutcome[R]:
        """The outcome; raises `ServerLost` within 3 s of the server's end, `NoAnswer` after `timeout` [s].

        Handles the node's task queue meanwhile, so not for handlers of a node that spins: those look at
        `outcome`. `on_tick` is called 20 times a second. A node asked to stop raises SystemExit.
        """
        self._heard = self._bus.clock.monotonic()
        is_over = self._loop.wait_for(lambda: self.is_over, timeout, on_tick)
        if self.outcome is not None:
            return self.outcome
        if self.lost is not None:
            raise self.lost
        if not is_over and self._loop.stop.is_set:
            raise SystemExit(0)
        raise NoAnswer(because("answer.goal.goes_on", goal=self.goal_id, key=self.action.key, time=timeout or 0.0))

    def cancel(self) -> None:
        """Asks the server to end the goal, until it answers; how it ended is then the outcome. Does not block."""
        self._wants_cancel = True
        self._ask_cancel()

    def accepted_at(self, stamp: int) -> None:
        """The server's decision came."""
        self._accepted = stamp
        self.heard()

    def heard(self) -> None:
        """The server lives."""
        self._heard = self._bus.clock.monotonic()

    def on_feedback(self, feedback: F) -> None:
        self.heard()
        self.feedback = feedback
        if self._on_feedback is not None:
            self._on_feedback(feedback)

    def on_status(self, message: GoalStatuses) -> None:
        """Follows the goal's status; asks for the result when it has ended."""
        if not self._accepted or message.stamp < self._accepted:
            return
        self.heard()
        if self._wants_cancel:
            self._ask_cancel()
        for goal in message.goals:
            if goal.goal_id == self.goal_id:
                self.status = goal.status
                if goal.status.is_terminal:
                    self._ask_result()
                return
        self._lose(because("answer.goal.restarted", server=self.action.server))

    def tick(self, now: float) -> None:
        """Detects a silent server; `now` in [s] monotonic. The router's absence does not count."""
        if not self._accepted or self.is_over:
            return
        if not self._bus.is_connected:
            self._away = self._away or now
            if now - self._away > ROUTER_TIMEOUT:
                self._lose(because("answer.goal.no_router", time=ROUTER_TIMEOUT))
        elif self._away is not None:
            self._away = None
            self.heard()
        elif now - self._heard > SERVER_TIMEOUT:
            self._lose(because("answer.goal.silent", server=self.action.server, time=SERVER_TIMEOUT))

    def _ask(self, request: AnyRequest, question: Message, on_answer: Callable[[BusReply | None], None]) -> None:
        def put(answer: BusReply | None) -> None:
            self._loop.tasks.put(lambda: on_answer(answer))

        self._bus.ask(request.key, schema_of(request.request), encode(question), ASK_TIMEOUT, put, request.urgent)

    def _ask_cancel(self) -> None:
        if not self._is_canceling and not self.is_over:
            self._is_canceling = True
            self._ask(keys.cancel_request(self.action), CancelRequest(goal_id=self.goal_id), self._on_cancel)

    def _on_cancel(self, answer: BusReply | None) -> None:
        """Without an answer the next sign of life asks again."""
        self._is_canceling = False
        if answer is not None and answer.ok:
            self._wants_cancel = False
            with suppress(BadMessage):
                self.cancel_refused = decode(CancelResponse, answer.payload).reason

    def _ask_result(self) -> None:
        if not self._is_asking and not self.is_over:
            self._is_asking = True
            self._ask(keys.result_request(self.action), ResultRequest(goal_id=self.goal_id), self._on_result)

    def _on_result(self, answer: BusReply | None) -> None:
        """Without an answer the next sign of life asks again."""
        self._is_asking = False
        if answer is None or not answer.ok or self.is_over:
            return
        try:
            response = decode(ResultResponse, answer.payload)
            if response.status.is_terminal:
                self.status = response.status
                self.outcome = ActionOutcome(response.status, decode(self.action.result, bytes(response.result)))
                self._tell_end()
        except BadMessage as error:
            self._lose(because("answer.goal.unreadable", server=self.action.server, error=str(error)))

    def _lose(self, why: Reason) -> None:
        if not self.is_over:
            self.lost = ServerLost(because("answer.goal.lost", why, goal=self.goal_id, key=self.action.key))
            self._tell_end()

    def _tell_end(self) -> None:
        if self.on_end is not None:
            self.on_end()
