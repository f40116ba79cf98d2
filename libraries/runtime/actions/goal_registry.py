"""The goals of an action's server: results are kept for two minutes, and no id is decided upon twice.

A server that was started anew knows no ids. It has another epoch, and takes only goals for that: one that was meant for
the server before it, and comes late or is said again, is void.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.actions import (
    NIL,
    GoalResponse,
    GoalStatus,
    GoalStatusCode,
    GoalStatuses,
    ResultRequest,
    ResultResponse,
)

KEPT = 120.0  # [s] that a result can be asked for after the end
MAX_KEPT = 256  # goals
MAX_DECIDED = 32_768  # ids of goals that were refused or are forgotten; some 4 MB
FORGOTTEN = GoalResponse(reason="a goal of this id has ended already: send it again with an id of its own")
EPOCH_BITS = 62  # of a random number; it is never 0, which a client says that does not know it
MAX_RESULT_WAIT = 5.0  # [s] that the answer to a result request may be held back


@dataclass
class GoalRecord:
    """The server's record of a goal."""

    goal_id: str
    client: str
    response: GoalResponse
    status: GoalStatusCode = GoalStatusCode.ACCEPTED
    result: msgspec.Raw = field(default_factory=lambda: NIL)
    session: str = ""  # that has sent it, as it says itself
    ended: float = 0.0  # [s] monotonic
    waiting: list[tuple[float, Pending[ResultResponse]]] = field(default_factory=list)  # until when, who

    def end(self, status: GoalStatusCode, result: msgspec.Raw, now: float) -> None:
        """Keeps the result and answers who waits for it; `now` in [s] monotonic."""
        self.status, self.result, self.ended = status, result, now
        for _, pending in self.waiting:
            pending.reply(ResultResponse(status=status, result=result))
        self.waiting.clear()

    def answer_overdue(self, now: float) -> None:
        """Answers the result requests that are due at `now` [s] monotonic with the present status."""
        for each in [each for each in self.waiting if now >= each[0]]:
            self.waiting.remove(each)
            each[1].reply(ResultResponse(status=self.status))


class GoalRegistry:
    """Goals by id, oldest first."""

    def __init__(self, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self.epoch = clock.bits(EPOCH_BITS) + 1
        self._goals: dict[str, GoalRecord] = {}
        self._decided: dict[str, GoalResponse] = {}  # refused or forgotten, oldest first

    def __getitem__(self, goal_id: str) -> GoalRecord:
        return self._goals[goal_id]

    def get(self, goal_id: str) -> GoalRecord | None:
        return self._goals.get(goal_id)

    def add(self, goal: GoalRecord) -> None:
        self._goals[goal.goal_id] = goal

    def refuse(self, goal_id: str, response: GoalResponse) -> GoalResponse:
        """Removes a goal that is not accepted; whoever sends that id again is answered `response` too."""
        self._goals.pop(goal_id, None)
        self._decided[goal_id] = response
        if len(self._decided) > MAX_DECIDED:
            del self._decided[next(iter(self._decided))]
        return response

    def response_to(self, goal_id: str) -> GoalResponse | None:
        """What a goal of that id is answered that comes again; None for a new one."""
        goal = self._goals.get(goal_id)
        return goal.response if goal else self._decided.get(goal_id)

    @property
    def active(self) -> tuple[str, ...]:
        """The goals that have not ended."""
        return tuple(goal.goal_id for goal in self._goals.values() if not goal.status.is_terminal)

    @property
    def statuses(self) -> GoalStatuses:
        """The status message of all goals."""
        goals = tuple(
            GoalStatus(goal_id=goal.goal_id, client=goal.client, status=goal.status) for goal in self._goals.values()
        )
        return GoalStatuses(stamp=self._clock.unix(), goals=goals)

    def forget_expired(self) -> None:
        """Forgets what was kept long enough, and answers who has waited long enough."""
        now = self._clock.monotonic()
        ended = [goal for goal in self._goals.values() if goal.status.is_terminal]
        for index, goal in enumerate(ended):
            if now - goal.ended > KEPT or index < len(ended) - MAX_KEPT:
                self.refuse(goal.goal_id, FORGOTTEN)
        for goal in self._goals.values():
            goal.answer_overdue(now)

    def answer_result(self, request: ResultRequest, pending: Pending[ResultResponse]) -> None:
        """At once, or when the goal ends, if the request may be held back."""
        goal = self._goals.get(request.goal_id)
        if goal is None:
            pending.reply(ResultResponse(status=GoalStatusCode.UNKNOWN, epoch=self.epoch))
        elif goal.status.is_terminal or request.wait <= 0.0:
            pending.reply(ResultResponse(status=goal.status, result=goal.result))
        else:
            goal.waiting.append((self._clock.monotonic() + min(request.wait, MAX_RESULT_WAIT), pending))
