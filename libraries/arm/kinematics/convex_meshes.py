"""Collision meshes that are convex, as coal's convex shapes: solid, and a hundred times as fast as their triangles."""

from __future__ import annotations

from collections import Counter

import coal
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_TRIANGLES = 400  # with more, coal's search along the corners is no longer fast
THINNEST = 1e-3  # as a share of the length
NO_VOLUME = 1e-6  # as a share of the length: of nothing qhull would end the process
FULL = 1.0 - 1e-4  # of its convex hull's volume, that a convex mesh has at least


def convex_or_same(geometry: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """The convex hull of a closed mesh that fills it; any other geometry as it is."""
    if not isinstance(geometry, coal.BVHModelBase) or not 4 <= geometry.num_tris <= MOST_TRIANGLES:
        return geometry
    if not _is_thick(np.array(geometry.vertices(), dtype=float).reshape(-1, 3)) or not _is_closed(geometry):
        return geometry
    hull = convex_hull(geometry)
    return hull if abs(geometry.computeVolume()) >= FULL * hull.computeVolume() > 0.0 else geometry


def convex_hull(mesh: coal.BVHModelBase) -> coal.Convex:
    """Of a mesh's vertices, which must have a volume: coal's qhull ends the process where they have none."""
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def hull_of(points: Array) -> coal.Convex:
    """The convex hull of points (n, 3) [m]; raises ValueError for those that have no volume."""
    if len(points) < 4 or not _is_thick(points, NO_VOLUME):
        raise ValueError(f"{len(points)} points on a plane, or not numbers, have no convex hull")
    several = coal.StdVec_Vec3s()
    several.extend(list(points))
    return coal.Convex.convexHull(several, True, "Qt")


def triangles_of(hull: coal.Convex) -> NDArray[np.int32]:
    """(m, 3) numbers of its corners, turned outwards."""
    rows = [(each[0], each[1], each[2]) for each in map(hull.polygons, range(hull.num_polygons))]
    faces, corners = np.array(rows, dtype=np.int32), corners_of(hull)
    first, second, third = (corners[column] for column in faces.T)
    outwards = np.einsum("ij,ij->i", np.cross(second - first, third - first), first - corners.mean(axis=0))
    return np.where((outwards < 0.0)[:, None], faces[:, ::-1], faces)


def corners_of(hull: coal.ConvexBase) -> Array:
    """(n, 3) [m]."""
    return np.array(hull.points(), dtype=float).reshape(-1, 3)


def _is_thick(vertices: Array, thinnest: float = THINNEST) -> bool:
    """True for finite vertices (n, 3) [m] that are on no plane, nor nearly: `thinnest` is a share of the length."""
    if not np.isfinite(vertices).all():
        return False
    away = vertices - vertices.mean(axis=0)
    extents = np.ptp(away @ np.linalg.svd(away, full_matrices=False)[2].T, axis=0)
    return bool(extents.min() > thinnest * extents.max())


def _is_closed(mesh: coal.BVHModelBase) -> bool:
    """True if every edge has a triangle on either side."""
    triangles = [(each[0], each[1], each[2]) for each in map(mesh.tri_indices, range(mesh.num_tris))]
    edges = Counter((one, two) for a, b, c in triangles for one, two in ((a, b), (b, c), (c, a)))
    return all(count == 1 and edges[two, one] == 1 for (one, two), count in edges.items())
