"""How a node's loop does: rate, lateness and CPU since the last report."""

from __future__ import annotations

import time

from schemas.system import NodeStatistics, TopicStatistics
from services.runtime.schedule import LoopFigures

SHORTEST = 0.5  # [s] that a report must cover


class LoopStatistics:
    """Turns counters into one `NodeStatistics` a second."""

    def __init__(self, node: str) -> None:
        self._node = node
        self._wall, self._cpu = time.monotonic(), time.process_time()

    def report(self, figures: LoopFigures, topics: tuple[TopicStatistics, ...]) -> NodeStatistics | None:
        """None where hardly any time has passed since the last one."""
        wall, cpu = time.monotonic(), time.process_time()
        elapsed = wall - self._wall
        if elapsed < SHORTEST:
            return None
        message = NodeStatistics(
            stamp=time.time_ns(),
            node=self._node,
            loop_rate=figures.steps / elapsed,
            loop_late_max=figures.late_max,
            cpu=(cpu - self._cpu) / elapsed,
            topics=topics,
        )
        self._wall, self._cpu = wall, cpu
        return message
