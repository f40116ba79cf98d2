"""How far apart two shapes are at least: in one sweep of numpy for all pairs, so that few are looked at exactly."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from services.planner.scene.world_geometry import WorldGeometry

Array = NDArray[np.float64]


class LowerBounds:
    """From the ball around one shape to the box around the other, and the other way round; of `pairs` alone."""

    def __init__(self, geometry: WorldGeometry) -> None:
        self._moving = geometry.moving
        self.pairs = range(geometry.direct, len(geometry.pairs))
        self._padding = np.array(geometry.padding[geometry.direct :])
        both = np.array(geometry.pairs[geometry.direct :], dtype=int).reshape(-1, 2)
        self._first, self._second = both.T
        self._centres, self._halves = geometry.boxes[:, 0], geometry.boxes[:, 1]
        self._radii = np.linalg.norm(self._halves, axis=1)
        placements = [shape.placement for shape in geometry.model.geometryObjects]
        self._rotations = np.array([placement.rotation for placement in placements])
        self._origins = np.array([placement.translation for placement in placements])

    def of(self, placed: pin.GeometryData) -> Array:
        """(k,) [m] for each of `pairs`, less its padding, where the shapes are now."""
        if not self.pairs:
            return self._padding
        for index in self._moving:
            placement = placed.oMg[index]
            self._rotations[index], self._origins[index] = placement.rotation, placement.translation
        balls = self._origins + np.einsum("gij,gj->gi", self._rotations, self._centres)
        both = np.maximum(
            self._gaps(balls, self._first, self._second),
            self._gaps(balls, self._second, self._first),
        )
        bounds: Array = np.where(both > 0.0, both, -np.inf)  # a box says nothing of how deep two shapes are in
        less: Array = bounds - self._padding
        return less

    def _gaps(self, balls: Array, ball: NDArray[np.int_], box: NDArray[np.int_]) -> Array:
        """(k,) [m] from the ball around the one to the box around the other; negative where they overlap."""
        inside = np.einsum("kji,kj->ki", self._rotations[box], balls[ball] - self._origins[box])
        outside = np.maximum(np.abs(inside - self._centres[box]) - self._halves[box], 0.0)
        return np.asarray(np.linalg.norm(outside, axis=1) - self._radii[ball])
