"""When a step is due: an exact rate without drift, however late single steps are."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class LoopFigures:
    """What a loop did since the last report."""

    steps: int = 0
    late_max: float = 0.0  # [s]


class Schedule:
    """Deadlines at `start + k / rate`; those that a long step slept through are left out."""

    def __init__(self, rate: float, start: float) -> None:
        if not rate > 0.0:
            raise ValueError(f"rate {rate} Hz: it must be above 0")
        self._start, self._rate, self._count = start, rate, 0
        self.figures = LoopFigures()

    @property
    def deadline(self) -> float:
        """[s] of the next step, on the clock of `start`."""
        return self._start + self._count / self._rate

    def begin(self, now: float) -> None:
        """Notes how late the step that begins at `now` is."""
        self.figures.steps += 1
        self.figures.late_max = max(self.figures.late_max, now - self.deadline)

    def end(self, now: float) -> None:
        """Moves on to the first deadline after `now`."""
        self._count = max(self._count + 1, int((now - self._start) * self._rate) + 1)

    def take_figures(self) -> LoopFigures:
        """The figures since the last call."""
        figures, self.figures = self.figures, LoopFigures()
        return figures
