"""Convex solids as the fit of spheres sees them: how deep a point lies, and what is the nearest point."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.collision_geometry.shapes import TriangleMesh

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
PROJECTIONS = 40  # onto one side of a polytope after the other; some ten are enough
PLANE_DIGITS = 9  # to which the sides' directions are rounded: two triangles of one side are one plane
THIN = 1e-7  # of its length is the height of a triangle whose direction nine digits do not tell


class ConvexSolid(Hashable, Protocol):
    """A convex solid about its own origin; points are (..., 3) [m]."""

    @property
    def half(self) -> Array:
        """(3,) half sizes [m] of the box around it."""

    def depth(self, points: Array) -> Array:
        """(...) [m] from `points` (..., 3) inside to the surface; below 0 outside."""

    def nearest(self, points: Array) -> Array:
        """(..., 3) [m] the points themselves, or the nearest ones of the solid to those outside."""


@dataclass(frozen=True)
class Box:
    """Half the lengths of its edges [m]."""

    half_sizes: tuple[float, float, float]

    @property
    def half(self) -> Array:
        """(3,) half sizes [m] of the box around it."""
        return np.array(self.half_sizes)

    def depth(self, points: Array) -> Array:
        """(...) [m] to the surface from inside; below 0 outside. Points are (..., 3) [m]."""
        over = np.abs(points) - self.half
        outside = np.linalg.norm(np.maximum(over, 0.0), axis=-1)
        depth: Array = np.where(outside > 0.0, -outside, -over.max(axis=-1))
        return depth

    def nearest(self, points: Array) -> Array:
        """(..., 3) [m] the points themselves, or the nearest ones of the solid to those outside."""
        nearest: Array = np.clip(points, -self.half, self.half)
        return nearest


@dataclass(frozen=True)
class Cylinder:
    """Along z, both ends flat; [m]."""

    radius: float
    half_length: float

    @property
    def half(self) -> Array:
        """(3,) half sizes [m] of the box around it."""
        return np.array([self.radius, self.radius, self.half_length])

    def depth(self, points: Array) -> Array:
        """(...) [m] to the surface from inside; below 0 outside. Points are (..., 3) [m]."""
        aside = np.hypot(points[..., 0], points[..., 1]) - self.radius
        above = np.abs(points[..., 2]) - self.half_length
        outside = np.hypot(np.maximum(aside, 0.0), np.maximum(above, 0.0))
        return np.where(outside > 0.0, -outside, -np.maximum(aside, above))

    def nearest(self, points: Array) -> Array:
        """(..., 3) [m] the points themselves, or the nearest ones of the solid to those outside."""
        aside = np.maximum(np.hypot(points[..., 0], points[..., 1]), self.radius)
        moved = points.copy()
        moved[..., :2] *= (self.radius / aside)[..., None]
        moved[..., 2] = np.clip(points[..., 2], -self.half_length, self.half_length)
        return moved


@dataclass(frozen=True)
class Capsule:
    """All points within `radius` of the line along z; a ball where `half_length` is 0; [m]."""

    radius: float
    half_length: float

    @property
    def half(self) -> Array:
        """(3,) half sizes [m] of the box around it."""
        return np.array([self.radius, self.radius, self.half_length + self.radius])

    def depth(self, points: Array) -> Array:
        """(...) [m] to the surface from inside; below 0 outside. Points are (..., 3) [m]."""
        distance: Array = np.linalg.norm(points - self._on_axis(points), axis=-1)
        return self.radius - distance

    def nearest(self, points: Array) -> Array:
        """(..., 3) [m] the points themselves, or the nearest ones of the solid to those outside."""
        axis = self._on_axis(points)
        off = points - axis
        distance = np.maximum(np.linalg.norm(off, axis=-1, keepdims=True), self.radius)
        nearest: Array = axis + off * (self.radius / distance)
        return nearest

    def _on_axis(self, points: Array) -> Array:
        axis = np.zeros_like(points)
        axis[..., 2] = np.clip(points[..., 2], -self.half_length, self.half_length)
        return axis


@dataclass(frozen=True)
class Polytope:
    """The convex hull of corners [m]; `planes` are its sides: a unit normal, and what that times a point is at most."""

    planes: tuple[tuple[float, ...], ...]
    half_sizes: tuple[float, float, float]  # of a box about its own origin, not about its middle

    @property
    def half(self) -> Array:
        """(3,) half sizes [m] of the box around it."""
        return np.array(self.half_sizes)

    def depth(self, points: Array) -> Array:
        """(...) [m] to the surface from inside; below 0 outside, there at most as far as the surface is. Points are
        (..., 3) [m]."""
        depth: Array = (self._offsets - points @ self._normals.T).min(axis=-1)
        return depth

    def nearest(self, points: Array) -> Array:
        """(..., 3) [m] the points themselves; for those outside a point of the surface, but for rounding.

        Each is projected onto the plane that it is farthest beyond, again and again (projections onto convex sets): no
        step brings it farther from any point of the solid.
        """
        moved = points.reshape(-1, 3).copy()
        for _ in range(PROJECTIONS):
            beyond = moved @ self._normals.T - self._offsets
            worst = beyond.argmax(axis=1)
            over = np.maximum(beyond[np.arange(len(moved)), worst], 0.0)
            if not over.any():
                break
            moved -= over[:, None] * self._normals[worst]
        return moved.reshape(points.shape)

    @cached_property
    def _normals(self) -> Array:
        return np.array(self.planes)[:, :3]

    @cached_property
    def _offsets(self) -> Array:
        return np.array(self.planes)[:, 3]


def polytope_around(mesh: TriangleMesh) -> Polytope:
    """The solid that a convex mesh is the surface of, its triangles turned outwards.

    Each side lies on the corner that is farthest out in its direction, so that no corner is outside, however little is
    known of a thin triangle's direction; that of the thinnest is left to its neighbours.
    """
    first, second, third = (mesh.vertices[column] for column in mesh.faces.T)
    normals = np.cross(second - first, third - first)
    sizes = np.linalg.norm(normals, axis=1)
    longest = np.max([np.linalg.norm(edge, axis=1) for edge in (second - first, third - second, first - third)], axis=0)
    wide = sizes > THIN * longest**2
    normals = np.unique(np.round(normals[wide] / sizes[wide, None], PLANE_DIGITS), axis=0)
    offsets = (mesh.vertices @ normals.T).max(axis=0)
    x, y, z = np.abs(mesh.vertices).max(axis=0).tolist()
    return Polytope(tuple(map(tuple, np.column_stack((normals, offsets)).tolist())), (x, y, z))
