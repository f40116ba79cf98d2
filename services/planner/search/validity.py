"""Whether postures, joint lines and curves keep a margin: asked of coal, or of the compiled core where it is built."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from services.planner.scene.clearance import Sweeper
from services.planner.search.curve import spline_rows

if TYPE_CHECKING:
    from services.planner.native import MotionCore

Array = NDArray[np.float64]

ROWS = 24  # postures in a span of a curve, between which coal looks as on straight lines


class Validity(Protocol):
    """Answers hold between samples too; joint values (n,), control points of a uniform cubic B-spline (k, n)."""

    def is_free(self, posture: Array) -> bool: ...
    def is_line_free(self, start: Array, goal: Array) -> bool: ...
    def is_curve_free(self, control: Array) -> bool: ...


class CoalValidity:
    """On the exact shapes: slow, and free as soon as the margin [m] is kept."""

    def __init__(self, checker: Sweeper, margin: float) -> None:
        self._checker, self._margin = checker, margin

    def is_free(self, posture: Array) -> bool:
        return self._checker.distance(posture) > self._margin

    def is_line_free(self, start: Array, goal: Array) -> bool:
        return self._checker.touching(np.vstack((start, goal)), self._margin) is None

    def is_curve_free(self, control: Array) -> bool:
        return self._checker.touching(spline_rows(control, ROWS), self._margin) is None


class NativeValidity:
    """On spheres that hold the links: a hundred times as fast, and a few mm more cautious."""

    def __init__(self, core: MotionCore) -> None:
        self._core = core

    def is_free(self, posture: Array) -> bool:
        return bool(self._core.free(posture[None, :])[0])

    def is_line_free(self, start: Array, goal: Array) -> bool:
        return self._core.edge_free(start, goal)

    def is_curve_free(self, control: Array) -> bool:
        return self._core.spline_free(control)
