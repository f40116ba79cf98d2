"""The server side of an action: decisions, feedback, kept results, heartbeat."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import msgspec

from gemelo.libraries.runtime.actions import keys as keys
from gemelo.libraries.runtime.actions.coming_goals import ComingGoals
from gemelo.libraries.runtime.actions.goal_registry import GoalRecord, GoalRegistry
from gemelo.libraries.runtime.bus.identity import is_token
from gemelo.libraries.runtime.client_watch import ClientWatch
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.loop.task_queue import Task
from gemelo.libraries.runtime.requests.server import Pending, RequestServer, shortened
from gemelo.libraries.runtime.topics import Publisher, Warn
from gemelo.schemas.actions import (
    CancelRequest,
    CancelResponse,
    GoalEnd,
    GoalFeedback,
    GoalRequest,
    GoalResponse,
    GoalStatusCode,
    GoalStatuses,
)
from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import Action

G = TypeVar("G", bound=Message)
F = TypeVar("F", bound=Message)
R = TypeVar("R", bound=Message)

EARLY_CANCEL_KEPT = 2.0  # [s] that a goal may come after its own cancel, which overtakes what waits
LONGEST_NAME = 256  # characters of a goal's id and of its client's token; chosen: ours have 32 and some 60
MAX_EARLY_CANCELS = 256  # such cancels that are remembered


@dataclass(frozen=True)
class GoalDecision:
    """The decision on a goal; a refusal has the action's own code and a reason that names the thing."""

    accepted: bool
    code: int = 0
    reason: str = ""
    why: Reason | None = None


def accept() -> GoalDecision:
    return GoalDecision(True)


def refuse(code: int, reason: str, why: Reason | None = None) -> GoalDecision:
    return GoalDecision(False, code, reason, why)


OnGoal = Callable[[str, G], GoalDecision]
OnCancel = Callable[[str], Reason | None]  # None: it is being cancelled; else why not
ReadGoal = Callable[[bytes], Generator[None, None, G]]  # yields between the pieces of a long one; raises `BadMessage`


class ActionServer(Generic[G, F, R]):
    """Everything here runs in the thread of logic."""

    HEARTBEAT = 0.25  # [s]

    def __init__(
        self,
        action: Action[G, F, R],
        on_goal: OnGoal[G],
        on_cancel: OnCancel,
        serve: Callable[[Any, Callable[[Any, Pending[Any]], None]], RequestServer[Any, Any]],
        publisher: Callable[[Any], Publisher[Any]],
        clients: ClientWatch,
        warn: Warn,
        post: Callable[[Task], None],
        clock: Clock = SYSTEM,
        read: ReadGoal[G] | None = None,
    ) -> None:
        """`read` decodes goals, in pieces where they are long."""
        self.action = action
        self._read = read or self._read_at_once
        self._clock = clock
        self._on_goal, self._on_cancel = on_goal, on_cancel
        self._goals, self._clients, self._warn = GoalRegistry(clock), clients, warn
        self._cancelled_early: dict[str, float] = {}  # by goal that has not come yet: [s] monotonic
        self._feedback: Publisher[GoalFeedback] = publisher(keys.feedback_topic(action))
        self._status: Publisher[GoalStatuses] = publisher(keys.status_topic(action))
        self._ended: Publisher[GoalEnd] = publisher(keys.ended_topic(action))
        self._goal_requests = serve(keys.goal_request(action), self._answer_goal)
        refusing = self._goal_requests.failures_refused
        self._coming = ComingGoals(self._goal_requests.request.key, self._answering, refusing, post)
        serve(keys.cancel_request(action), self._answer_cancel)
        serve(keys.result_request(action), self._goals.answer_result)
        self.beat()

    @property
    def epoch(self) -> int:
        """That a goal must name to be taken; another one each time that the server starts."""
        return self._goals.epoch

    def feedback(self, goal_id: str, feedback: F) -> None:
        """Publishes feedback of a goal."""
        self._feedback.put(GoalFeedback(goal_id=goal_id, feedback=msgspec.Raw(encode(feedback))))

    def executing(self, goal_id: str) -> None:
        """The goal is being carried out."""
        if (goal := self._goals.get(goal_id)) is not None:
            self._set(goal, GoalStatusCode.EXECUTING)

    def finish(self, goal_id: str, status: GoalStatusCode, result: R) -> None:
        """The goal has ended; its result is kept for two minutes. Ending it twice is an error.

        One that was refused because its decision failed, though the core had begun it, ends unseen.
        """
        if not status.is_terminal:
            raise ValueError(f"a goal cannot end as {status.name}")
        goal = self._goals.get(goal_id)
        if goal is None:
            return
        if goal.status.is_terminal:
            raise ValueError(f"goal {goal_id} has ended already, as {goal.status.name}")
        raw = msgspec.Raw(encode(result))
        goal.end(status, raw, self._clock.monotonic())
        self._clients.forget(goal_id)
        self._publish_status()
        end = GoalEnd(stamp=self._clock.unix(), goal_id=goal_id, client=goal.client, status=status, result=raw)
        self._ended.put(end)

    def refuse_waiting(self, reason: Reason, asked: Mapping[str, int]) -> None:
        """Refuses the goals that were sent before a stop that is handled now and were not looked at yet.

        `asked` are the clients that want it, as in `Pending.asked`.
        """
        self._coming.refuse(reason)
        self._goal_requests.refuse_waiting(reason, asked)

    def session_of(self, goal_id: str) -> str:
        """The session that has sent a goal that is decided upon, or was accepted; empty where it did not say."""
        return self._goals[goal_id].session

    @property
    def active(self) -> tuple[str, ...]:
        """The goals that have not ended, oldest first."""
        return self._goals.active

    def beat(self) -> None:
        """The server's sign of life; forgets what was kept long enough, and cancels goals whose client is gone."""
        self._goals.forget_expired()
        for goal_id, client in self._clients.take_lost(self._clock.monotonic()):
            self._cancel_lost(goal_id, client)
        self._publish_status()

    def _answer_goal(self, request: GoalRequest, pending: Pending[GoalResponse]) -> None:
        self._coming.take(request, pending)

    def _answering(self, request: GoalRequest, pending: Pending[GoalResponse]) -> Iterator[None]:
        response = self._void(request) or self._goals.response_to(request.goal_id)
        if response is None:
            self._require_form(request)
            try:
                wanted = yield from self._read(bytes(request.goal))
            except BadMessage as error:
                raise RequestRefused(f"{self.action.key}: {error}", "bad request") from error
            response = self._decide(request, wanted, pending.client)
        pending.reply(response)
        self._publish_status()

    def _read_at_once(self, payload: bytes) -> Generator[None, None, G]:
        yield from ()  # one piece
        return decode(self.action.goal, payload)

    def _void(self, request: GoalRequest) -> GoalResponse | None:
        """The refusal of a goal meant for another process in this one's place; one that names none is taken."""
        if request.epoch in (0, self.epoch):
            return None
        why = because("goal.void", server=self.action.server)
        return GoalResponse(reason=str(why), why=why, stamp=self._clock.unix())

    def _require_form(self, request: GoalRequest) -> None:
        """Raises `RequestRefused`."""
        if not request.goal_id:
            raise RequestRefused(because("request.goal.no_id", action=self.action.key), "bad request")
        for code, text in (("request.goal.long_id", request.goal_id), ("request.goal.long_client", request.client)):
            if len(text) > LONGEST_NAME:
                why = because(code, action=self.action.key, size=len(text), most=LONGEST_NAME)
                raise RequestRefused(why, "bad request")
        if request.attached and not is_token(request.client):  # whose end nobody would ever see
            why = because("request.goal.no_token", action=self.action.key, client=request.client[:80])
            raise RequestRefused(why, "bad request")

    def _decide(self, request: GoalRequest, wanted: G, session: str) -> GoalResponse:
        if self._cancelled_early.pop(request.goal_id, None) is not None:
            return self._canceled_early(request.goal_id)
        response = GoalResponse(accepted=True, stamp=self._clock.unix())
        goal = GoalRecord(request.goal_id, request.client, response, session=session)
        self._goals.add(goal)
        failed = because("goal.server_failed")
        decision = refuse(0, str(failed), failed)
        try:
            decision = self._on_goal(request.goal_id, wanted)
        finally:
            if not decision.accepted:
                reason = shortened(decision.reason)
                refusal = GoalResponse(code=decision.code, reason=reason, why=decision.why, stamp=self._clock.unix())
                response = self._goals.refuse(request.goal_id, refusal)
        if decision.accepted and request.attached and not goal.status.is_terminal:
            self._clients.add(request.goal_id, request.client, self._clock.monotonic())
        return response

    def _canceled_early(self, goal_id: str) -> GoalResponse:
        why = because("cancel.before_it_began")
        return self._goals.refuse(goal_id, GoalResponse(reason=str(why), why=why, stamp=self._clock.unix()))

    def _answer_cancel(self, request: CancelRequest, pending: Pending[CancelResponse]) -> None:
        if request.goal_id and request.goal_id not in self.active:
            pending.reply(_cancel_response((), [self._cancel_absent(request.goal_id)]))
            return
        if not request.goal_id:
            self.refuse_waiting(because("cancel.all_after_it"), pending.asked)
        wanted = (request.goal_id,) if request.goal_id else self.active
        canceling, reasons = [], [] if wanted else [because("cancel.none_active")]
        for goal_id in wanted:
            reason = self._cancel(goal_id)
            if reason is not None:
                reasons.append(reason)
            else:
                canceling.append(goal_id)
        pending.reply(_cancel_response(tuple(canceling), reasons))

    def _cancel_absent(self, goal_id: str) -> Reason:
        """Why `goal_id` is not active; one that is not known may have been overtaken by its own cancel."""
        known = self._goals.get(goal_id)
        if known is not None:
            return because("cancel.ended", status=known.status.name)
        if (coming := self._coming.take_out(goal_id)) is not None:
            coming.reply(self._canceled_early(goal_id))
            return because("cancel.undecided")
        now = self._clock.monotonic()
        self._cancelled_early = {key: at for key, at in self._cancelled_early.items() if now - at < EARLY_CANCEL_KEPT}
        if len(self._cancelled_early) < MAX_EARLY_CANCELS and len(goal_id) <= LONGEST_NAME:
            self._cancelled_early[goal_id] = now
        return because("cancel.unknown", time=EARLY_CANCEL_KEPT)

    def _cancel(self, goal_id: str) -> Reason | None:
        """None if the goal is being cancelled, else why not."""
        reason = self._on_cancel(goal_id)
        if reason is None and not self._goals[goal_id].status.is_terminal:
            self._set(self._goals[goal_id], GoalStatusCode.CANCELING)
        return reason

    def _cancel_lost(self, goal_id: str, client: str) -> None:
        """Nobody watches an attached goal any more."""
        reason = self._cancel(goal_id)
        became = "so it is cancelled" if reason is None else f"and it cannot be cancelled: {reason}"
        self._warn(f"goal {goal_id}: its client {client} is gone, {became}")

    def _set(self, goal: GoalRecord, status: GoalStatusCode) -> None:
        if not goal.status.is_terminal and goal.status is not status:
            goal.status = status
            self._publish_status()

    def _publish_status(self) -> None:
        self._status.put(self._goals.statuses)


def _cancel_response(canceling: tuple[str, ...], reasons: list[Reason]) -> CancelResponse:
    """`reasons` of the goals that are not cancelled."""
    why = reasons[0] if len(reasons) == 1 else because("cancel.several", *reasons) if reasons else None
    return CancelResponse(canceling=canceling, reason=str(why or ""), why=why)
