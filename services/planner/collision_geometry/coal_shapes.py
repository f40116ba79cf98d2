"""Our solids as coal's, and what coal does not say of meshes: whether a point is inside."""

from __future__ import annotations

from collections import deque
from functools import lru_cache

import coal
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.convex_meshes import convex_hull
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh

Array = NDArray[np.float64]
# Tuning constants: chosen, where a line does not say measured or standard.
WHOLE_TURN = 4.0 * np.pi  # the solid angle of everything


def geometry_of(shape: CollisionShape) -> coal.CollisionGeometry:
    """The solid around its own origin, without its padding."""
    size = shape.size
    match shape.kind:
        case ShapeKind.BOX:
            return coal.Box(*size)
        case ShapeKind.SPHERE:
            return coal.Sphere(size[0])
        case ShapeKind.CYLINDER:
            return coal.Cylinder(size[0], size[1])
        case ShapeKind.CAPSULE:
            return coal.Capsule(size[0], size[1])
        case ShapeKind.HALF_SPACE:
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        case ShapeKind.MESH:
            assert shape.mesh is not None
            return tree_of(shape.mesh)
        case ShapeKind.HULL:
            assert shape.mesh is not None
            return hull_around(shape.mesh)


def hull_around(mesh: TriangleMesh) -> coal.Convex:
    """The convex hull of a mesh's vertices, as coal has it."""
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(mesh.faces), len(mesh.vertices))
    tree.addVertices(mesh.vertices)
    tree.addTriangles(mesh.faces.astype(np.int64))
    tree.endModel()
    return convex_hull(tree)


@lru_cache(maxsize=64)
def tree_of(mesh: TriangleMesh) -> coal.BVHModelOBBRSS:
    """The mesh's surface as a tree of boxes: built once for as long as it is among the newest."""
    tree = coal.BVHModelOBBRSS()
    tree.beginModel(len(mesh.faces), len(mesh.vertices))
    tree.addVertices(mesh.vertices)
    tree.addTriangles(mesh.faces.astype(np.int64))
    tree.endModel()
    if tree.num_tris != len(mesh.faces):
        raise ValueError(f"coal took {tree.num_tris} of {len(mesh.faces)} triangles")
    return tree


def is_inside(mesh: TriangleMesh, point: Array) -> bool:
    """True if the surface goes around `point` (3,) [m] in the mesh's frame, holes or not.

    By the generalised winding number (Jacobson et al. 2013) of the solid angles of its triangles (Van Oosterom and
    Strackee 1983); either orientation of the triangles counts.
    """
    if not ((mesh.vertices.min(axis=0) < point) & (point < mesh.vertices.max(axis=0))).all():
        return False
    a, b, c = np.moveaxis((mesh.vertices - point)[mesh.faces], 1, 0)
    lengths = [np.linalg.norm(corner, axis=1) for corner in (a, b, c)]
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", one, other) for one, other in ((b, c), (c, a), (a, b))]
    shape = lengths[0] * lengths[1] * lengths[2] + sum(dot * length for dot, length in zip(dots, lengths, strict=True))
    return bool(abs(2.0 * np.arctan2(volume, shape).sum()) > 0.5 * WHOLE_TURN)


def mesh_of(geometry: coal.CollisionGeometry) -> TriangleMesh | None:
    """The triangles of a geometry that has any; of equal ones in a row the same."""
    if not isinstance(geometry, coal.BVHModelBase):
        return None
    for known, mesh in _KNOWN:
        if known.num_tris == geometry.num_tris and known == geometry:
            return mesh
    triangles = [(each[0], each[1], each[2]) for each in map(geometry.tri_indices, range(geometry.num_tris))]
    faces = np.array(triangles, dtype=np.int32).reshape(-1, 3)
    mesh = TriangleMesh(np.array(geometry.vertices()).reshape(-1, 3), faces)
    _KNOWN.append((geometry, mesh))
    return mesh


_KNOWN: deque[tuple[coal.BVHModelBase, TriangleMesh]] = deque(maxlen=32)  # the newest
