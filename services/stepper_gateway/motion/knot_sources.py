"""Motions: paths and streamed targets as a sequence of knots, taken as the device needs them."""

from __future__ import annotations

import math
from typing import Protocol

from gemelo.schemas.message import Vector
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.paths import TimedPath
from gemelo.services.stepper_gateway.motion.target_tracker import TargetTracker

KNOT_TIME = 0.02  # [s] between knots; chosen: one for each state of the device


class KnotSource(Protocol):
    """Knots after the one where it starts, `dt_us` apart."""

    @property
    def dt_us(self) -> int: ...

    @property
    def is_finished(self) -> bool:
        """True if the last knot, at rest, has been taken."""

    def take(self, count: int) -> list[Knot]:
        """The next knots, at most `count` of them."""


class PathKnots:
    """A path in equal steps of at most `KNOT_TIME`, ending at rest exactly at its end."""

    def __init__(self, path: TimedPath) -> None:
        self._path = path
        self._count = max(1, math.ceil(path.duration / KNOT_TIME - 1e-9))
        self.dt_us = max(1000, math.ceil(path.duration / self._count * 1e6 - 1e-6))
        self._next = 1

    @property
    def start(self) -> Vector:
        """[rad] or [m] where the path begins."""
        return self._path.at(0.0).position

    @property
    def duration_us(self) -> int:
        return self._count * self.dt_us

    @property
    def is_finished(self) -> bool:
        return self._next > self._count

    def take(self, count: int) -> list[Knot]:
        last = min(self._next + count, self._count + 1)
        knots = [self._knot(index) for index in range(self._next, last)]
        self._next = last
        return knots

    def _knot(self, index: int) -> Knot:
        if index >= self._count:
            return Knot.at_rest(self._path.at(self._path.duration).position)
        return self._path.at(index * self.dt_us * 1e-6)


class TargetKnots:
    """Whatever the tracker makes of the targets; ends at rest after the stream has fallen silent."""

    def __init__(self, tracker: TargetTracker) -> None:
        self._tracker = tracker
        self._is_finished = False
        self.dt_us = round(tracker.dt * 1e6)

    @property
    def is_finished(self) -> bool:
        return self._is_finished

    def take(self, count: int) -> list[Knot]:
        knots: list[Knot] = []
        while len(knots) < count and not self._is_finished:
            knots.append(self._tracker.step())
            self._is_finished = self._tracker.is_braking and knots[-1].is_at_rest
        return knots
