"""The movement along a path, as stretches of steady jerk one after the other, and the times at which it is told."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Stretch = tuple[float, float, float, float, float]  # [s] duration, then length, speed, acceleration, jerk at its begin

# Tuning constants: chosen, where a line does not say measured or standard.
NEWTON = 8  # steps to where a length is reached; chosen: each doubles the digits, the last ones change nothing
FEWEST = 1e-3  # [s] times nearer than that are one; chosen: a slot of the device


class TimeLaw:
    """The path's length by time, from rest to rest."""

    def __init__(self, stretches: Iterable[Stretch]) -> None:
        self._durations, *states = np.array(list(stretches)).T
        self._states = np.array(states)
        ends = np.cumsum(self._durations)
        self._stamps = np.concatenate(([0.0], ends[:-1]))
        self.duration = float(ends[-1])

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """(m,) length, speed and acceleration at `times` (m,) [s]."""
        row = np.searchsorted(self._stamps, times, side="right") - 1
        s, v, a, j = self._states[:, row]
        t = times - self._stamps[row]
        return s + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j

    def reached(self, lengths: Array) -> Array:
        """(m,) [s] when the path between its ends is so long (m,), by Newton from where the speed is highest."""
        row = np.searchsorted(self._states[0], lengths, side="right") - 1
        s, v, a, j = self._states[:, row]
        most = self._durations[row]
        t = np.where(2.0 * a + most * j > 0.0, most, 0.0)
        for _ in range(NEWTON):
            missing = s + t * (v + t * (a / 2.0 + t * j / 6.0)) - lengths
            t = np.clip(t - missing / np.maximum(v + t * (a + t * j / 2.0), 1e-12), 0.0, most)
        times: Array = self._stamps[row] + t
        return times

    def times(self, lengths: Array, spacing: float) -> Array:
        """Times [s] from 0 to the end: where the jerk changes, where the path has each of `lengths`, and between them
        evenly, at most `spacing` [s] apart."""
        marks = np.sort(np.concatenate((self._stamps, self.reached(lengths), [self.duration])))
        marks = marks[np.concatenate(([True], np.diff(marks) > FEWEST))]
        marks[-1] = self.duration
        parts = np.maximum(1, np.ceil(np.diff(marks) / spacing)).astype(int)
        first = np.repeat(np.cumsum(parts) - parts, parts)
        shares = (np.arange(len(first)) - first) / np.repeat(parts, parts)
        times: Array = np.repeat(marks[:-1], parts) + shares * np.repeat(np.diff(marks), parts)
        return np.append(times, self.duration)
