"""Shapes as the compiled core wants them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from services.planner.covers.shapes import Mesh, Shape, ShapeKind
from services.planner.native.chain import transform_row
from services.planner.native.library import motion

Array = NDArray[np.float64]


def obstacle_of(shape: Shape, pose: Array, padding: float = 0.0, touching: int = 0) -> motion.Obstacle:
    """The shape at `pose` (4, 4), larger by `padding` [m]; `touching` has a bit for every part that may touch it."""
    number, size, radius = _form(shape)
    compiled = None if shape.mesh is None else _compiled(shape.mesh)
    around = radius + shape.padding + padding
    return motion.obstacle(number, transform_row(pose), np.array(size), around, touching, compiled)


@lru_cache(maxsize=64)
def _compiled(mesh: Mesh) -> motion.Mesh:
    """Built once for as long as it is among the newest: the costly part of a mesh."""
    return motion.mesh(*mesh.arrays)


def _form(shape: Shape) -> tuple[int, tuple[float, float, float], float]:
    """Number, size and radius as views.h has them: what is round is a point, a line or a box with a radius."""
    size = shape.size
    match shape.kind:
        case ShapeKind.BOX:
            return 0, (0.5 * size[0], 0.5 * size[1], 0.5 * size[2]), 0.0
        case ShapeKind.SPHERE:
            return 0, (0.0, 0.0, 0.0), size[0]
        case ShapeKind.CAPSULE:
            return 0, (0.0, 0.0, 0.5 * size[1]), size[0]
        case ShapeKind.CYLINDER:
            return 1, (size[0], 0.0, 0.5 * size[1]), 0.0
        case ShapeKind.HALF_SPACE:
            return 2, (0.0, 0.0, 0.0), 0.0
        case ShapeKind.MESH:
            return 3, (0.0, 0.0, 0.0), 0.0
