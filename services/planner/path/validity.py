"""Validity of configurations, joint lines and curves for the searches: each keeps a margin."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.curve import spline_rows

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
ROWS = 24  # configurations in a span of a curve, between which it is looked at as straight


class TouchingCheck(Protocol):
    """Coal, as a `World`, or the native planner where it can tell and coal in doubt, as `CollisionChecker`."""

    def touching(self, positions: Array, margin: float) -> Array | None:
        """A configuration (n,) [rad] or [m] on the polyline through `positions` (m, n) that does not keep `margin` [m],
        or None."""


class ValidityChecker:
    """Answers hold between samples too; joint values (n,), control points of a uniform cubic B-spline (k, n)."""

    def __init__(self, checker: TouchingCheck, margin: float) -> None:
        self._checker, self._margin = checker, margin

    def is_free(self, configuration: Array) -> bool:
        """True if the configuration (n,) [rad] or [m] keeps the margin."""
        return self.is_line_free(configuration, configuration)

    def is_line_free(self, start: Array, goal: Array) -> bool:
        """True if the straight joint path between two configurations (n,) [rad] or [m] keeps the margin."""
        return self._checker.touching(np.array((start, goal)), self._margin) is None

    def is_curve_free(self, control: Array) -> bool:
        """True if the uniform cubic B-spline of the control points (k, n) [rad] or [m] keeps the margin."""
        return self._checker.touching(spline_rows(control, ROWS), self._margin) is None
