"""Control of the arm for the time of the goals of ROS, where nobody else holds it."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from gemelo.libraries.runtime.clock import token
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.control import ControlAnswer, ControlGive, ControlTake
from gemelo.schemas.reasons import Reason, plain
from gemelo.schemas.topics import CONTROL, CONTROL_GIVE, CONTROL_TAKE

HOLDER = "ROS 2"
TO_REST = 15.0  # [s] that the arm may take to come to rest, where another moves it
TO_ANSWER = 2.0  # [s]

Then = Callable[[Reason | None], None]


class HoldState(Enum):
    """How this process stands to control."""

    FREE = "free"
    TAKING = "taking"
    HELD = "held"
    GIVING = "giving"


class ControlForGoals:
    """Taken with the first goal, given back after the last one; waits for nothing."""

    def __init__(self, node: Node) -> None:
        self._node, self._state = node, HoldState.FREE
        self._newest = node.latest(CONTROL)
        self._secret, self._hold = "", (0, 0)  # epoch and number
        self._goals = 0
        self._waiting: list[Then] = []

    def acquire(self, then: Then) -> None:
        """`then(None)` once this process has control, or `then(reason)`; each None wants one `release`."""
        if self._state is HoldState.HELD and not self._is_ours():
            self._state, self._goals = HoldState.FREE, 0  # taken by force
        if self._state is HoldState.HELD:
            self._goals += 1
            then(None)
            return
        self._waiting.append(then)
        if self._state is HoldState.FREE:
            self._take()

    def release(self) -> None:
        """One goal is over."""
        self._goals = max(0, self._goals - 1)
        if self._goals == 0 and self._state is HoldState.HELD:
            self._give()

    def _is_ours(self) -> bool:
        state = self._newest.message
        return state is None or not state.held or (state.epoch, state.number) == self._hold

    def _take(self) -> None:
        def answer() -> None:
            try:
                self._taken(pending.response())
            except (RequestRefused, NoAnswer) as error:
                self._not_taken(error.reason)

        self._state, self._secret = HoldState.TAKING, token(self._node.clock, 256)
        question = ControlTake(name=HOLDER, client=self._node.token, secret=self._secret)
        pending = self._node.ask_at_once(CONTROL_TAKE, question, TO_REST, lambda: self._node.post(answer))

    def _taken(self, answer: ControlAnswer) -> None:
        if not answer.accepted:
            self._not_taken(answer.why or plain(answer.reason))
            return
        self._state, self._hold = HoldState.HELD, (answer.epoch, answer.number)
        waiting, self._waiting = self._waiting, []
        self._goals += len(waiting)
        for then in waiting:
            then(None)

    def _not_taken(self, why: Reason) -> None:
        self._state = HoldState.FREE
        waiting, self._waiting = self._waiting, []
        for then in waiting:
            then(why)

    def _give(self) -> None:
        def answer() -> None:
            self._state = HoldState.FREE  # where it was not given back, it was lost before
            if self._waiting:
                self._take()

        self._state = HoldState.GIVING
        self._node.ask_at_once(
            CONTROL_GIVE, ControlGive(secret=self._secret), TO_ANSWER, lambda: self._node.post(answer)
        )
