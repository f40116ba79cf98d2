"""The collision shapes of an arm's links, read from its URDF."""

from __future__ import annotations

from functools import lru_cache

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.kinematics.convex_meshes import corners_of, hull_of, triangles_of
from gemelo.libraries.arm.kinematics.self_collisions import load_collision_geometry
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.collision_geometry.coal_shapes import mesh_of
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh
from gemelo.services.planner.collision_geometry.solids import (
    Box,
    Capsule,
    ConvexSolid,
    Cylinder,
    Polytope,
    polytope_around,
)

Array = NDArray[np.float64]
Form = tuple[ShapeKind, tuple[float, ...], TriangleMesh | None]


def link_shapes(arm: ArmDescription) -> dict[str, tuple[CollisionShape, ...]]:
    """The collision shapes of every link that has any, in the link's frame; raises `DescriptionError` where one could
    not be loaded."""
    model = pin.buildModelFromUrdf(str(arm.urdf_path))
    shapes: dict[str, tuple[CollisionShape, ...]] = {}
    for item in load_collision_geometry(arm, model).geometryObjects:
        frame = model.frames[item.parentFrame]
        placement = frame.placement.actInv(item.placement)
        x, y, z, w = pin.Quaternion(placement.rotation).coeffs().tolist()
        form, size, mesh = _form_of(item.geometry, frame.name)
        shape = CollisionShape(item.name, form, size, (tuple(placement.translation.tolist()), (x, y, z, w)), mesh)
        shapes[frame.name] = (*shapes.get(frame.name, ()), shape)
    return shapes


def _form_of(geometry: coal.CollisionGeometry, link: str) -> Form:
    """A shape of coal's as one of ours."""
    match geometry:
        case coal.Box():
            return ShapeKind.BOX, tuple((2.0 * geometry.halfSide).tolist()), None
        case coal.Cylinder():
            return ShapeKind.CYLINDER, (float(geometry.radius), 2.0 * float(geometry.halfLength)), None
        case coal.Capsule():
            return ShapeKind.CAPSULE, (float(geometry.radius), 2.0 * float(geometry.halfLength)), None
        case coal.Sphere():
            return ShapeKind.SPHERE, (float(geometry.radius),), None
        case coal.BVHModelBase():
            return ShapeKind.MESH, (), mesh_of(geometry)
        case coal.ConvexBase():
            return ShapeKind.HULL, (), hull_mesh(corners_of(geometry))
    would_do = remedy("simple_shapes")
    raise DescriptionError(because("robot.link.shape", would_do, link=link, kind=type(geometry).__name__))


def hull_mesh(points: Array) -> TriangleMesh:
    """The convex hull of points (n, 3) [m], its triangles turned outwards; of equal points the same mesh, so that what
    is built of it is built once. Raises ValueError for points that have no volume."""
    return _hull_mesh(np.ascontiguousarray(points, dtype=float).tobytes())


@lru_cache(maxsize=1024)
def _hull_mesh(content: bytes) -> TriangleMesh:
    hull = hull_of(np.frombuffer(content).reshape(-1, 3))
    return TriangleMesh(corners_of(hull), triangles_of(hull))


@lru_cache(maxsize=1024)
def _polytope_of(mesh: TriangleMesh) -> Polytope:
    return polytope_around(mesh)


def solid_of(shape: CollisionShape) -> ConvexSolid:
    """Its solid about its own origin; raises ValueError for a mesh and for what has no end."""
    size = shape.size
    match shape.kind:
        case ShapeKind.BOX:
            return Box((0.5 * size[0], 0.5 * size[1], 0.5 * size[2]))
        case ShapeKind.SPHERE:
            return Capsule(size[0], 0.0)
        case ShapeKind.CYLINDER:
            return Cylinder(size[0], 0.5 * size[1])
        case ShapeKind.CAPSULE:
            return Capsule(size[0], 0.5 * size[1])
        case ShapeKind.HULL:
            assert shape.mesh is not None
            return _polytope_of(shape.mesh)
    raise ValueError(f'"{shape.name}": a {shape.kind} has no end and cannot be covered')
