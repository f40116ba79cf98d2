"""How often messages come, in the shape that `topic hz` has everywhere."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise


class RateWindow:
    """Arrival times [s, monotonic] of the last `size` messages."""

    def __init__(self, size: int = 10_000) -> None:
        self._times: deque[float] = deque(maxlen=size)
        self.total = 0  # messages ever seen

    def add(self, time: float) -> None:
        self._times.append(time)
        self.total += 1

    def report(self) -> str | None:
        """Two lines, or None where fewer than two messages have come."""
        if len(self._times) < 2:
            return None
        times = list(self._times)
        gaps = [after - before for before, after in pairwise(times)]
        mean = sum(gaps) / len(gaps)
        deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps))
        rate = 1.0 / mean if mean > 0.0 else math.inf
        return (
            f"average rate: {rate:.3f}\n"
            f"\tmin: {min(gaps):.3f}s max: {max(gaps):.3f}s std dev: {deviation:.5f}s window: {len(times)}"
        )
