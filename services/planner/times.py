"""Where the time of a plan goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from schemas.planning import PlanningTimes


class Stopwatch:
    """Adds up the phases of `PlanningTimes`; what runs inside another phase counts for the inner one alone."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._spent = dict.fromkeys(PlanningTimes.__struct_fields__, 0.0)
        self._inner = 0.0
        self.newest = ""  # the phase begun last; another thread may look

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        began, outer, self._inner = self._clock(), self._inner, 0.0
        self.newest = name
        try:
            yield
        finally:
            took = self._clock() - began
            self._spent[name] += took - self._inner
            self._inner = outer + took

    @property
    def times(self) -> PlanningTimes:
        return PlanningTimes(**self._spent)
