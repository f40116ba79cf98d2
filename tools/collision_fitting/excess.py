"""Excess of fitted shapes over their mesh: over the outer surface, and at the worst place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import trimesh
from numpy.typing import NDArray

from gemelo.libraries.arm.model.urdf import Triple
from gemelo.services.planner.collision_geometry.link_shapes import solid_of
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh
from gemelo.tools.collision_fitting.fitted_shape import Fitted
from gemelo.tools.collision_fitting.mesh_surface import MeshSurface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Tuning constants: chosen, where a line does not say measured or standard.
SHARE = 0.95  # of the outer surface, that is to be within the bound
STEP, MOST_STEPS = 0.004, 16  # [m] between places on a shape, and how many along an edge at most
AROUND = 32  # places on a circle
ON_A_BALL = 500
MOST_ON_A_HULL = 1500
GOLDEN = np.pi * (3.0 - np.sqrt(5.0))  # [rad]: Fibonacci's spiral on a ball
BURIED = -1e-5  # [m] deep in another shape, from where on a place is no outer surface


@dataclass(frozen=True)
class Excess:
    """`p95` [m] is what `SHARE` of the outer surface stays within, `worst` [m] what its farthest `place` [m] reaches;
    `share` of it is within the bound that was asked for."""

    share: float
    p95: float
    worst: float
    place: Triple


class ShapeSurface:
    """Places on a fitted shape, the areas that they stand for [m^2], how far each is from the mesh [m], and the corners
    `low` and `high` (3,) [m] of a box around it all."""

    def __init__(self, fitted: Fitted, mesh: MeshSurface) -> None:
        self.fitted, self.shapes = fitted, fitted.shapes
        found = [_surface(shape) for shape in self.shapes]
        outer = [_outer(points, self.shapes, index) for index, (points, _) in enumerate(found)]
        self.points = np.vstack([points[mask] for (points, _), mask in zip(found, outer, strict=True)])
        self.areas = np.concatenate([areas[mask] for (_, areas), mask in zip(found, outer, strict=True)])
        self.beyond = mesh.distances(self.points)
        halves = [np.abs(shape.rotation) @ solid_of(shape).half - BURIED for shape in self.shapes]
        at = [np.array(shape.pose[0]) for shape in self.shapes]
        self.low = np.min([place - half for place, half in zip(at, halves, strict=True)], axis=0)
        self.high = np.max([place + half for place, half in zip(at, halves, strict=True)], axis=0)
        self._free: WeakKeyDictionary[ShapeSurface, Mask] = WeakKeyDictionary()

    def share_within(self, within: float) -> float:
        """Of its own surface, that is within so many [m] of the mesh."""
        return float(self.areas[self.beyond <= within].sum() / self.areas.sum())

    def free_of(self, other: ShapeSurface) -> Mask:
        """(n,) True for the places that are in no shape of the other."""
        if other not in self._free:
            held = ((self.points > other.low) & (self.points < other.high)).all(axis=1)
            held[held] = depth_in(other.shapes, self.points[held]) > BURIED
            self._free[other] = ~held
        return self._free[other]


def outer_places(surfaces: Sequence[ShapeSurface]) -> list[Mask]:
    """For each surface True for the places that are in no other shape."""
    return [
        np.logical_and.reduce(
            [np.ones(len(each.points), dtype=bool), *(each.free_of(other) for other in surfaces if other is not each)]
        )
        for each in surfaces
    ]


def excess_of(fitted: Sequence[Fitted], mesh: MeshSurface, within: float) -> Excess:
    """Of shapes together, with `within` [m] asked for; exact at each place beyond it and at the farthest ones."""
    surfaces = [ShapeSurface(each, mesh) for each in fitted]
    masks = outer_places(surfaces)
    points = np.concatenate([one.points[mask] for one, mask in zip(surfaces, masks, strict=True)])
    areas = np.concatenate([one.areas[mask] for one, mask in zip(surfaces, masks, strict=True)])
    beyond = np.concatenate([one.beyond[mask] for one, mask in zip(surfaces, masks, strict=True)])
    is_far = beyond >= min(within, _reached(beyond, areas))  # the others are no farther than this says
    beyond[is_far] = mesh.exact_distances(points[is_far])
    worst = int(np.argmax(beyond))
    x, y, z = points[worst].tolist()
    share = float(areas[beyond <= within].sum() / areas.sum())
    return Excess(share, _reached(beyond, areas), float(beyond[worst]), (x, y, z))


def _reached(beyond: Array, areas: Array) -> float:
    """[m] that `SHARE` of the areas stays within."""
    order = np.argsort(beyond, kind="stable")
    covered = np.cumsum(areas[order]) / areas.sum()
    return float(beyond[order][min(int(np.searchsorted(covered, SHARE)), len(order) - 1)])


def depth_in(shapes: Sequence[CollisionShape], points: Array) -> Array:
    """(n,) [m] that points (n, 3) are inside the shape that holds each best, below 0 outside all of them."""
    return np.asarray(np.max([depths(shape, points) for shape in shapes], axis=0))


def depths(shape: CollisionShape, points: Array) -> Array:
    """(n,) [m] that points (n, 3) are inside the shape, below 0 outside."""
    return solid_of(shape).depth((points - shape.pose[0]) @ shape.rotation)


def _outer(points: Array, shapes: Sequence[CollisionShape], index: int) -> Mask:
    others = [shape for place, shape in enumerate(shapes) if place != index]
    return depth_in(others, points) <= BURIED if others else np.ones(len(points), dtype=bool)


def _surface(shape: CollisionShape) -> tuple[Array, Array]:
    """Places (n, 3) [m] in the link, edges and corners among them, and areas (n,) [m^2]."""
    match shape.kind:
        case ShapeKind.BOX:
            local, areas = _on_box(np.array(shape.size))
        case ShapeKind.CYLINDER:
            local, areas = _on_cylinder(*shape.size)
        case ShapeKind.HULL:
            assert shape.mesh is not None
            local, areas = _on_hull(shape.mesh)
        case _:
            local, areas = _on_ball(shape.size[0])
    return local @ shape.rotation.T + shape.pose[0], areas


def _steps(length: float) -> tuple[Array, Array]:
    """Places along an edge, both ends among them, and the length that each stands for."""
    count = int(np.clip(np.ceil(length / STEP), 2, MOST_STEPS))
    lengths = np.full(count + 1, length / count)
    lengths[[0, -1]] *= 0.5
    return np.linspace(-0.5 * length, 0.5 * length, count + 1), lengths


def _on_box(size: Array) -> tuple[Array, Array]:
    places, areas = [], []
    for axis in range(3):
        (u, du), (v, dv) = _steps(size[(axis + 1) % 3]), _steps(size[(axis + 2) % 3])
        for side in (-0.5, 0.5):
            face = np.empty((len(u) * len(v), 3))
            face[:, axis] = side * size[axis]
            face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = np.repeat(u, len(v)), np.tile(v, len(u))
            places.append(face)
            areas.append(np.outer(du, dv).ravel())
    return np.vstack(places), np.concatenate(areas)


def _on_cylinder(radius: float, length: float) -> tuple[Array, Array]:
    turns = 2.0 * np.pi * np.arange(AROUND) / AROUND
    circle = np.column_stack((np.cos(turns), np.sin(turns)))
    heights, along = _steps(length)
    side = np.column_stack((np.tile(radius * circle, (len(heights), 1)), np.repeat(heights, AROUND)))
    radii, across = _steps(2.0 * radius)
    keep = radii > -1e-12
    radii, across = np.maximum(radii[keep], 0.0), across[keep]
    disc = (radii[:, None, None] * circle).reshape(-1, 2)
    disc_areas = np.repeat(np.maximum(radii, 0.25 * across) * across, AROUND)
    disc_areas *= np.pi * radius**2 / disc_areas.sum()
    ends = [np.column_stack((disc, np.full(len(disc), 0.5 * sign * length))) for sign in (-1.0, 1.0)]
    areas = (np.repeat(along, AROUND) * 2.0 * np.pi * radius / AROUND, disc_areas, disc_areas)
    return np.vstack((side, *ends)), np.concatenate(areas)


def _on_hull(mesh: TriangleMesh) -> tuple[Array, Array]:
    corners = mesh.vertices[mesh.faces]
    sides = corners[:, 1:] - corners[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    count = int(np.clip(areas.sum() / STEP**2, ON_A_BALL, MOST_ON_A_HULL))
    whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    drawn, _ = trimesh.sample.sample_surface(whole, count, seed=0)
    each = np.concatenate((np.full(len(drawn), areas.sum() / len(drawn)), np.zeros(len(mesh.vertices))))
    return np.vstack((drawn, mesh.vertices)), each


def _on_ball(radius: float) -> tuple[Array, Array]:
    numbers = np.arange(ON_A_BALL)
    z = 1.0 - 2.0 * (numbers + 0.5) / ON_A_BALL
    aside, turns = np.sqrt(1.0 - z**2), GOLDEN * numbers
    places = radius * np.column_stack((aside * np.cos(turns), aside * np.sin(turns), z))
    return places, np.full(ON_A_BALL, 4.0 * np.pi * radius**2 / ON_A_BALL)
