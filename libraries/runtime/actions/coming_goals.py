"""Goals that have come and are not decided upon yet, in their order.

A long one is read and checked in pieces, between which the event loop does what else is due: no stop waits for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import NamedTuple

from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.loop.task_queue import Task
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.actions import GoalRequest, GoalResponse
from gemelo.schemas.reasons import Reason, because

MOST_BYTES = 64 * 1024 * 1024  # of all that wait; chosen: two of the largest goals (bus/wire.py)

Answering = Callable[[GoalRequest, Pending[GoalResponse]], Iterator[None]]
Refusing = Callable[[Pending[GoalResponse]], AbstractContextManager[None]]


class ComingGoal(NamedTuple):
    """One of them."""

    request: GoalRequest
    pending: Pending[GoalResponse]
    pieces: Iterator[None]  # of its answering: after the last one it is answered


class ComingGoals:
    """Those of one action; all in the thread of logic."""

    def __init__(self, key: str, answering: Answering, refusing: Refusing, post: Callable[[Task], None]) -> None:
        """`refusing` makes a refusal of what is raised in it; `post` puts a task at the end of the loop's queue."""
        self._key, self._answering, self._refusing, self._post = key, answering, refusing, post
        self._goals: deque[ComingGoal] = deque()
        self._is_posted = False

    def take(self, request: GoalRequest, pending: Pending[GoalResponse]) -> None:
        """Answers a goal, at once if it is short and no other waits; raises `RequestRefused` where too much waits."""
        waiting = sum(len(memoryview(each.request.goal)) for each in self._goals)
        if self._goals and waiting + len(memoryview(request.goal)) > MOST_BYTES:
            raise RequestRefused(because("waiting.goals", key=self._key, waiting=waiting, limit=MOST_BYTES), "busy")
        self._goals.append(ComingGoal(request, pending, self._answering(request, pending)))
        if not self._is_posted:
            self._go_on()

    def refuse(self, reason: Reason) -> None:
        """Refuses all: a stop has overtaken them."""
        goals, self._goals = self._goals, deque()
        for each in goals:
            each.pending.refuse("void", because("request.void", reason, request=self._key))

    def take_out(self, goal_id: str) -> Pending[GoalResponse] | None:
        """Who waits for the answer to that goal, which is not decided upon any more; None if it is not here."""
        found = next((each for each in self._goals if each.request.goal_id == goal_id), None)
        if found is None:
            return None
        self._goals.remove(found)
        return found.pending

    def _go_on(self) -> None:
        self._is_posted = False
        while self._goals:
            goal, is_left = self._goals[0], False
            with self._refusing(goal.pending):
                is_left = next(goal.pieces, self) is None  # a piece is None
            if is_left:
                self._is_posted = True
                self._post(self._go_on)
                return
            if self._goals and self._goals[0] is goal:
                self._goals.popleft()
