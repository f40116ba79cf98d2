"""The living nodes of a robot as a recording keeps them: found by their statistics, and asked what they speak."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from msgspec.structs import replace

from gemelo.libraries.runtime.clock_offset import ClockOffset, measured
from gemelo.libraries.runtime.endpoints import info_request, interfaces_request, parameters_request
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.client import PendingCall
from gemelo.schemas.message import Message
from gemelo.schemas.system import Empty, Interfaces, NodeInfo, NodeRecord, NodeStatistics, Parameters
from gemelo.schemas.topics import STATISTICS, Request

PERIOD = 5.0  # [s] between two questions to a node: it may have got a new topic
GONE = 3.0 * PERIOD  # [s] without a word of a node, after which its place is another's
TIMEOUT = 2.0  # [s]
MAX_NODES = 256  # that are asked; more would be no robot's


@dataclass
class Asked:
    """One node that is being asked, until all three answers are there."""

    name: str  # its address
    at: int  # [ns] when the first of them left
    answers: dict[str, Message] = field(default_factory=dict)
    clock: ClockOffset | None = None

    def record(self, stamp: int) -> NodeRecord | None:
        info, spoken, set_to = (self.answers.get(key) for key in ("NodeInfo", "Interfaces", "Parameters"))
        if isinstance(info, NodeInfo) and isinstance(spoken, Interfaces) and isinstance(set_to, Parameters):
            record = NodeRecord(
                stamp=stamp, node=self.name, info=replace(info, clock=0), topics=spoken.topics,
                parameters=set_to.parameters,
            )  # fmt: skip
            clock = self.clock
            return record if clock is None else replace(record, clock_offset=clock.offset, clock_bound=clock.bound)
        return None


class Census:
    """Calls `on_record(record)`, in the thread of logic, for every new node and for each that has changed."""

    def __init__(self, node: Node, on_record: Callable[[NodeRecord], None]) -> None:
        self._node, self._on_record = node, on_record
        self._asked_at: dict[str, float] = {}  # [s] monotonic
        self._started: dict[str, int] = {}  # [ns] UNIX start of the process that was asked
        self._known: dict[str, NodeRecord] = {}
        node.subscribe_signed(STATISTICS, self._on_statistics)

    def _on_statistics(self, message: NodeStatistics, address: str) -> None:
        now = self._node.monotonic()
        is_new = self._started.get(address) != message.started
        if address not in self._asked_at and not self._has_place(now):
            return
        if is_new or now - self._asked_at[address] > PERIOD:
            self._asked_at[address], self._started[address] = now, message.started
            self.ask(Asked(address, self._node.now()))

    def _has_place(self, now: float) -> bool:
        """True if one more node can be asked; those of commands that have ended long ago make place."""
        if len(self._asked_at) >= MAX_NODES:
            for name in [name for name, at in self._asked_at.items() if now - at > GONE]:
                del self._asked_at[name], self._started[name]
                self._known.pop(name, None)
        return len(self._asked_at) < MAX_NODES

    def ask(self, asked: Asked) -> None:
        """All that is to be known of a node; its answers come later."""
        for request in (info_request, interfaces_request, parameters_request):  # the first one also for its clock
            self._ask_one(asked, request(asked.name))

    def _ask_one(self, asked: Asked, request: Request[Empty, Any]) -> None:
        began = self._node.monotonic()

        def on_answer() -> None:
            took = self._node.monotonic() - began
            self._node.post(lambda: self._take(asked, pending, took))

        pending = self._node.ask_at_once(request, Empty(), TIMEOUT, on_answer)

    def _take(self, asked: Asked, pending: PendingCall[Empty, Any], took: float) -> None:
        """`took` [s] is the round trip."""
        try:
            answer = pending.response()
        except (NoAnswer, RequestRefused):  # it has just ended, or there never was one of that name
            return
        asked.answers[type(answer).__name__] = answer
        if isinstance(answer, NodeInfo) and answer.clock:
            asked.clock = measured(asked.at, answer.clock, took)
        record = asked.record(self._node.now())
        if record is not None and is_news(self._known.get(asked.name, NodeRecord()), record):
            self._known[asked.name] = record
            self._on_record(record)


def is_news(before: NodeRecord, record: NodeRecord) -> bool:
    """True if a node speaks of other things, or its clock has moved farther against ours than both errors explain."""
    if record != replace(
        before, stamp=record.stamp, clock_offset=record.clock_offset, clock_bound=record.clock_bound,
        info=replace(before.info, ready=record.info.ready, problem=record.info.problem),
    ):  # fmt: skip
        return True
    if before.clock_offset is None or record.clock_offset is None:
        return before.clock_offset is not record.clock_offset
    return abs(record.clock_offset - before.clock_offset) > record.clock_bound + before.clock_bound
