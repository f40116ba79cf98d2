"""Tables of distances between two links, as the native planner reads them before it looks at spheres."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class JointsBetween(NamedTuple):
    """Two links, and which of the arm's joints move them against one another by how much at most per unit, in [m/rad]
    or [m/m]."""

    first: str
    second: str
    reaches: dict[int, float]


class Axis(NamedTuple):
    """The values of a joint that a table knows, [rad] or [m]; with `is_turn` a whole turn."""

    drive: int
    low: float
    high: float
    is_turn: bool

    @property
    def row(self) -> tuple[float, float, float, float]:
        """As the native planner wants it, in the units of the axis."""
        return float(self.drive), self.low, self.high, float(self.is_turn)


class PairTable(NamedTuple):
    """`bounds` (rows, columns) [m] that two links keep at least, by the cells of the joints of `axes`; of one joint
    there is one column."""

    first: str
    second: str
    axes: tuple[Axis, Axis]
    bounds: Array
