"""Collision shapes for an arm that has only meshes: fitted to what each link looks like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import trimesh
from numpy.typing import NDArray

from services.arm.errors import DescriptionError, suggestion
from services.arm.model.description import Arm
from services.collision_fitting.fitted_shape import Fitted
from services.collision_fitting.link_meshes import visual_mesh
from services.collision_fitting.parts import shapes_around
from services.planner.collision_geometry.coal_shapes import tree_of
from services.planner.collision_geometry.link_shapes import solid_of
from services.planner.collision_geometry.shapes import CollisionShape, TriangleMesh

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
MOST = 6  # shapes of a link
FACETS = 12  # along each edge of the box around a shape, where the path to the mesh is measured


@dataclass(frozen=True)
class LinkFit:
    """The shapes around one link's mesh; `share` of the volume of the mesh's convex hull that they add up to."""

    link: str
    mesh: TriangleMesh
    shapes: tuple[Fitted, ...]
    share: float
    overshoot: float  # [m] that the farthest point of the shapes is away from the mesh


def fit_links(arm: Arm, most: int = MOST, only: Sequence[str] = ()) -> list[LinkFit]:
    """Of every link with a visual mesh, or of those named; raises `DescriptionError` with what is wrong and where."""
    for name in only:
        if name not in arm.model.link_names:
            raise DescriptionError(
                f'{arm.urdf_path}: there is no link "{name}"{suggestion(name, arm.model.link_names)}'
            )
    wanted = [link for link in arm.model.links if not only or link.name in only]
    meshes = {link.name: visual_mesh(link, arm.urdf_path.parent) for link in wanted}
    bare = [name for name in only if meshes[name] is None]
    if bare or not any(meshes.values()):
        of = f'link "{bare[0]}" has' if bare else "its links have"
        raise DescriptionError(f"{arm.urdf_path}: {of} no visual mesh to fit shapes to: write <collision> by hand")
    return [_fit(name, mesh, most) for name, mesh in meshes.items() if mesh is not None]


def _fit(link: str, mesh: TriangleMesh, most: int) -> LinkFit:
    shapes = tuple(shapes_around(mesh, most))
    hull = float(trimesh.convex.convex_hull(mesh.vertices).volume)
    return LinkFit(link, mesh, shapes, sum(shape.volume for shape in shapes) / hull, overshoot(shapes, mesh))


def overshoot(fitted: Sequence[Fitted], mesh: TriangleMesh) -> float:
    """[m] from the mesh to the farthest point of the shapes' surface, of those that are in no other shape."""
    tree, point = tree_of(mesh), coal.Sphere(1e-9)
    shapes = [shape for each in fitted for shape in each.shapes]
    farthest = 0.0
    for shape in shapes:
        there = _surface(shape)
        for other in shapes:
            if other is not shape:
                there = there[depths(other, there) <= 0.0]
        for place in there:
            pose = coal.Transform3s(np.eye(3), place)
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            farthest = max(farthest, float(coal.distance(tree, coal.Transform3s(), point, pose, request, result)))
    return farthest


def _surface(shape: CollisionShape) -> Array:
    """(k, 3) points on it, its corners and rims among them: nearest to those of a box around it."""
    solid = solid_of(shape)
    steps = np.linspace(-1.0, 1.0, FACETS + 1)
    across = np.array([(x, y) for x in steps for y in steps])
    sides = [np.insert(across, axis, side, axis=1) for axis in range(3) for side in (-1.0, 1.0)]
    local = solid.nearest(np.vstack(sides) * (solid.half * 1.01))
    return local @ shape.rotation.T + shape.pose[0]


def depths(shape: CollisionShape, points: Array) -> Array:
    """(n,) [m] that points (n, 3) are inside the shape, below 0 outside."""
    return solid_of(shape).depth((points - shape.pose[0]) @ shape.rotation)
