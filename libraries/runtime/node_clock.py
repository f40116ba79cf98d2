"""The clock of another node, which may run on another host: measured again and again by round trips on the bus."""

from __future__ import annotations

import threading
from collections import deque

from gemelo.libraries.runtime.clock_offset import ClockOffset, best, measured
from gemelo.libraries.runtime.endpoints import info_request
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.client import PendingCall
from gemelo.schemas.system import Empty, NodeInfo

PERIOD = 2.0  # [s] between two questions
TIMEOUT = 1.0  # [s] an answer that took longer would say little
KEPT = 8  # measurements; the shortest round trip among them counts
ROUNDS = 4  # questions of a person, one after another


class NodeClock:
    """What the stamps of `other` mean here; `to_own` may be called from any thread."""

    def __init__(self, node: Node, other: str) -> None:
        """Asks from the thread of logic, and waits for nothing."""
        self._node, self._other = node, other
        self._kept: deque[tuple[float, ClockOffset]] = deque(maxlen=KEPT)  # with when [s] monotonic
        self._started = 0  # [ns] when the other node has started: another process may be on another host
        self._lock = threading.Lock()
        node.post(self._begin)

    def offset(self) -> ClockOffset | None:
        """What its clock shows more than ours; None before the first answer."""
        now = self._node.monotonic()
        with self._lock:
            return best(each.later(now - when) for when, each in self._kept)

    def to_own(self, stamp: int) -> int | None:
        """The moment [ns] of a stamp by this node's clock; None before the first answer."""
        offset = self.offset()
        return None if offset is None else offset.to_own(stamp)

    def close(self) -> None:
        """Asks no more."""
        self._node.forget(self._ask)

    def _begin(self) -> None:
        self._node.every(PERIOD, self._ask)
        self._ask()

    def _ask(self) -> None:
        if self._other not in self._node.alive():
            return
        asked, began = self._node.now(), self._node.monotonic()

        def on_answer() -> None:  # in a thread of the bus: what waits in the queue of tasks is no part of the way
            took = self._node.monotonic() - began
            self._node.post(lambda: self._take(pending, asked, took))

        pending = self._node.ask_at_once(info_request(self._other), Empty(), TIMEOUT, on_answer)

    def _take(self, pending: PendingCall[Empty, NodeInfo], asked: int, took: float) -> None:
        try:
            self.hear(pending.response(), asked, took)
        except (NoAnswer, RequestRefused):
            return

    def hear(self, info: NodeInfo, asked: int, took: float) -> None:
        """An answer to what was asked at `asked` [ns], after `took` [s]."""
        if not info.clock:
            return
        with self._lock:
            if info.started != self._started:
                self._kept.clear()
                self._started = info.started
            fresh, now = measured(asked, info.clock, took), self._node.monotonic()
            known = best(each.later(now - when) for when, each in self._kept)
            if known is not None and abs(known.offset - fresh.offset) > known.bound + fresh.bound:
                self._kept.clear()  # one of both clocks was set
            self._kept.append((now, fresh))


def ask_about(node: Node, other: str, timeout: float) -> tuple[NodeInfo, ClockOffset | None]:
    """What a node says of itself, and its clock against ours; blocks up to `timeout` [s] for each of a few questions.

    Raises `NoAnswer` or `RequestRefused`.
    """
    found = []
    for _ in range(ROUNDS):
        asked, began = node.now(), node.monotonic()
        info = node.call(info_request(other), Empty(), timeout)
        found.append(measured(asked, info.clock, node.monotonic() - began))
    return info, best(found) if info.clock else None
