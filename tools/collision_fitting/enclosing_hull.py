"""A convex hull with few sides around points: what is convex, but neither a box nor round, needs no more of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from gemelo.libraries.arm.model.urdf import Origin
from gemelo.tools.collision_fitting.fitted_shape import Fitted, FittedKind
from gemelo.tools.collision_fitting.hull import corners_and_sides

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SLACK = 0.001  # [m] that a corner may stand beyond the points' own hull
MOST_SIDES = 48
MARGIN = 2e-6  # [m] that a side is farther out: a file of triangles holds floats
THINNEST = 2e-4  # [m] from one side of the points to the other, below which there is no hull
FLAT = 2e-3  # the same as a share of the length: a flatter mesh is not read as a solid
APART = 12.0  # parts of a unit length, that sides of different directions differ in
AXES = np.vstack((np.eye(3), -np.eye(3)))


def enclosing_hull(points: Array, normals: Array) -> Fitted | None:
    """Around all `points` (n, 3) [m], with sides along the unit `normals` (m, 3) among others; None where they have no
    volume.

    Sides are added where a corner stands out the farthest, each along a side of the points' own hull, until none does.
    """
    corners, _ = corners_and_sides(points)
    spans = (
        np.linalg.svd(corners - corners.mean(axis=0), full_matrices=False)[2] if len(corners) > 3 else np.zeros((0,))
    )
    extents = np.ptp(corners @ spans.T, axis=0) if len(spans) else np.zeros(1)
    if extents.min() < max(THINNEST, FLAT * extents.max()):
        return None
    try:
        found = _corners_around(corners, np.vstack((AXES, normals, -normals)))
        low, high = found.min(axis=0), found.max(axis=0)
        middle = np.round(0.5 * (low + high), 6)
        local = found - middle
        volume = float(ConvexHull(local).volume)
    except QhullError:  # thin in a direction that is none of the spans
        return None
    x, y, z = middle.tolist()
    return Fitted(FittedKind.HULL, (volume,), Origin((x, y, z)), tuple((a, b, c) for a, b, c in local.tolist()))


def _corners_around(points: Array, normals: Array) -> Array:
    """(n, 3) [m] of the polytope with sides along the `normals` and as many more as it takes."""
    equations = ConvexHull(points).equations
    equations = equations[np.unique(np.round(APART * equations[:, :3]), axis=0, return_index=True)[1]]
    own, offsets = equations[:, :3], -equations[:, 3]
    inner = points.mean(axis=0)
    while True:
        reach = (points @ normals.T).max(axis=0) + MARGIN
        corners = HalfspaceIntersection(np.column_stack((normals, -reach)), inner).intersections
        beyond = corners @ own.T - offsets
        if beyond.max() <= SLACK or len(normals) >= MOST_SIDES:
            return np.asarray(corners)
        normals = np.vstack((normals, own[int(np.argmax(beyond.max(axis=0)))]))
