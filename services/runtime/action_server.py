"""The server's side of an action: decisions, feedback, results that are kept, and a heartbeat."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

import msgspec

from schemas.actions import (
    NOTHING,
    CancelRequest,
    CancelResponse,
    GoalFeedback,
    GoalRequest,
    GoalResponse,
    GoalStatus,
    GoalStatusCode,
    GoalStatuses,
    ResultRequest,
    ResultResponse,
)
from schemas.message import BadMessage, Message, decode, encode
from schemas.topics import Action
from services.runtime import action_keys as keys
from services.runtime.errors import Refused
from services.runtime.requests import Pending
from services.runtime.topics import Publisher

G = TypeVar("G", bound=Message)
F = TypeVar("F", bound=Message)
R = TypeVar("R", bound=Message)

KEPT = 120.0  # [s] that a result can be asked for after the end
MOST_KEPT = 256  # goals
LONGEST_WAIT = 5.0  # [s] that the answer to a result request may be held back


@dataclass(frozen=True)
class GoalDecision:
    """Whether a goal is accepted; if not, the action's own code and a reason that names the thing."""

    accepted: bool
    code: int = 0
    reason: str = ""


def accept() -> GoalDecision:
    return GoalDecision(True)


def refuse(code: int, reason: str) -> GoalDecision:
    return GoalDecision(False, code, reason)


OnGoal = Callable[[str, G], GoalDecision]
OnCancel = Callable[[str], str]


@dataclass
class Goal:
    """What the server knows of a goal."""

    goal_id: str
    client: str
    response: GoalResponse
    status: GoalStatusCode = GoalStatusCode.ACCEPTED
    result: msgspec.Raw = field(default_factory=lambda: NOTHING)
    ended: float = 0.0  # [s] monotonic
    waiting: list[tuple[float, Pending[ResultResponse]]] = field(default_factory=list)  # until when, who


class ActionServer(Generic[G, F, R]):
    """Everything here runs in the thread of logic."""

    HEARTBEAT = 0.25  # [s]

    def __init__(
        self,
        action: Action[G, F, R],
        on_goal: OnGoal[G],
        on_cancel: OnCancel,
        serve: Callable[[Any, Callable[[Any, Pending[Any]], None]], object],
        publisher: Callable[[Any], Publisher[Any]],
    ) -> None:
        self.action = action
        self._on_goal, self._on_cancel = on_goal, on_cancel
        self._goals: dict[str, Goal] = {}
        self._feedback: Publisher[GoalFeedback] = publisher(keys.feedback_topic(action))
        self._status: Publisher[GoalStatuses] = publisher(keys.status_topic(action))
        serve(keys.goal_request(action), self._answer_goal)
        serve(keys.cancel_request(action), self._answer_cancel)
        serve(keys.result_request(action), self._answer_result)
        self.beat()

    def feedback(self, goal_id: str, feedback: F) -> None:
        """Tells the clients how the goal stands."""
        self._feedback.put(GoalFeedback(goal_id=goal_id, feedback=msgspec.Raw(encode(feedback))))

    def executing(self, goal_id: str) -> None:
        """The goal is being carried out."""
        self._set(self._goals[goal_id], GoalStatusCode.EXECUTING)

    def finish(self, goal_id: str, status: GoalStatusCode, result: R) -> None:
        """The goal has ended; its result is kept for `KEPT` seconds. Ending it twice is an error."""
        if not status.is_terminal:
            raise ValueError(f"a goal cannot end as {status.name}")
        goal = self._goals[goal_id]
        if goal.status.is_terminal:
            raise ValueError(f"goal {goal_id} has ended already, as {goal.status.name}")
        goal.result, goal.ended = msgspec.Raw(encode(result)), time.monotonic()
        self._set(goal, status)
        for _, pending in goal.waiting:
            pending.reply(ResultResponse(status=goal.status, result=goal.result))
        goal.waiting.clear()

    @property
    def active(self) -> tuple[str, ...]:
        """The goals that have not ended, oldest first."""
        return tuple(goal.goal_id for goal in self._goals.values() if not goal.status.is_terminal)

    def beat(self) -> None:
        """The server's sign of life; forgets what was kept long enough."""
        now = time.monotonic()
        ended = [goal for goal in self._goals.values() if goal.status.is_terminal]
        for index, goal in enumerate(ended):
            if now - goal.ended > KEPT or index < len(ended) - MOST_KEPT:
                del self._goals[goal.goal_id]
        for goal in self._goals.values():
            self._answer_overdue(goal, now)
        self._publish_status()

    def _answer_overdue(self, goal: Goal, now: float) -> None:
        for each in [each for each in goal.waiting if now >= each[0]]:
            goal.waiting.remove(each)
            each[1].reply(ResultResponse(status=goal.status))

    def _answer_goal(self, request: GoalRequest, pending: Pending[GoalResponse]) -> None:
        known = self._goals.get(request.goal_id)
        pending.reply(known.response if known else self._decide(request))
        self._publish_status()

    def _decide(self, request: GoalRequest) -> GoalResponse:
        if not request.goal_id:
            raise Refused(f"{self.action.key}: a goal needs an id", "bad request")
        try:
            wanted = decode(self.action.goal, bytes(request.goal))
        except BadMessage as error:
            raise Refused(f"{self.action.key}: {error}", "bad request") from error
        goal = Goal(request.goal_id, request.client, GoalResponse(accepted=True, stamp=time.time_ns()))
        self._goals[request.goal_id] = goal
        decision = refuse(0, "the server failed")
        try:
            decision = self._on_goal(request.goal_id, wanted)
        finally:
            if not decision.accepted:
                del self._goals[request.goal_id]
        if decision.accepted:
            return goal.response
        return GoalResponse(accepted=False, code=decision.code, reason=decision.reason, stamp=time.time_ns())

    def _answer_cancel(self, request: CancelRequest, pending: Pending[CancelResponse]) -> None:
        if request.goal_id and request.goal_id not in self.active:
            known = self._goals.get(request.goal_id)
            reason = f"it has ended as {known.status.name}" if known else "no such goal is known here"
            pending.reply(CancelResponse(reason=reason))
            return
        wanted = (request.goal_id,) if request.goal_id else self.active
        canceling, reasons = [], [] if wanted else ["no goal is active"]
        for goal_id in wanted:
            reason = self._on_cancel(goal_id)
            if reason:
                reasons.append(reason)
                continue
            canceling.append(goal_id)
            if not self._goals[goal_id].status.is_terminal:
                self._set(self._goals[goal_id], GoalStatusCode.CANCELING)
        pending.reply(CancelResponse(canceling=tuple(canceling), reason="; ".join(reasons)))

    def _answer_result(self, request: ResultRequest, pending: Pending[ResultResponse]) -> None:
        goal = self._goals.get(request.goal_id)
        if goal is None:
            pending.reply(ResultResponse(status=GoalStatusCode.UNKNOWN))
        elif goal.status.is_terminal or request.wait <= 0.0:
            pending.reply(ResultResponse(status=goal.status, result=goal.result))
        else:
            goal.waiting.append((time.monotonic() + min(request.wait, LONGEST_WAIT), pending))

    def _set(self, goal: Goal, status: GoalStatusCode) -> None:
        if not goal.status.is_terminal:
            goal.status = status
            self._publish_status()

    def _publish_status(self) -> None:
        goals = tuple(
            GoalStatus(goal_id=goal.goal_id, client=goal.client, status=goal.status) for goal in self._goals.values()
        )
        self._status.put(GoalStatuses(stamp=time.time_ns(), goals=goals))
