"""Thinning of one source's samples between two batches; while nothing changes, only two a second are kept."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gemelo.services.visualizer.content.updates import Times
from gemelo.services.visualizer.model.rotations import Array

LAST_STAMP = 2**63 - 1  # [ns] of a 64-bit time column
CLOCK_CHANGED = 1_000_000_000  # [ns] a stamp that goes back by more is a new clock, not an old sample
KEEP_ALIVE = 500_000_000  # [ns] between samples that say the same

Sample = tuple[int, tuple[float, ...]]


class ThinnedSeries:
    """Rows of a fixed width in the order of their stamps."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._kept: list[Sample] = []
        self._last: Sample | None = None  # newest kept
        self._held: Sample | None = None  # newest that said the same as the last kept

    @property
    def newest(self) -> tuple[float, ...] | None:
        """The newest row (width,) in the [unit] of its source, kept or not."""
        return None if self._last is None else self._last[1]

    def add(self, stamp: int, row: Sequence[float]) -> None:
        """A row (width,) at `stamp` [ns]; one that is not newer than the last is left out."""
        sample = stamp, tuple(row)
        if not 0 <= stamp <= LAST_STAMP:
            return
        newest = self._held or self._last
        if self._last is None or newest is None or stamp < newest[0] - CLOCK_CHANGED:
            self._keep(sample)
        elif stamp <= newest[0]:
            return
        elif sample[1] != self._last[1]:
            # The line must stay level up to the change.
            if self._held is not None:
                self._keep(self._held)
            self._keep(sample)
        elif stamp - self._last[0] >= KEEP_ALIVE:
            self._keep(sample)
        else:
            self._held = sample

    def take(self, latest: int = LAST_STAMP) -> tuple[Times, Array]:
        """Stamps (n,) and rows (n, width) kept since the last call; of those after `latest` [ns] nothing is left."""
        kept, self._kept = [sample for sample in self._kept if sample[0] <= latest], []
        times = np.array([stamp for stamp, _ in kept], dtype=np.int64)
        return times, np.array([row for _, row in kept], dtype=np.float64).reshape(len(kept), self._width)

    def _keep(self, sample: Sample) -> None:
        self._kept.append(sample)
        self._last, self._held = sample, None
