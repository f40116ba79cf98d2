"""Primitives as triangle meshes, so that they can be translucent; optionally grown by a margin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gemelo.services.visualizer.model.rotations import Array
from gemelo.services.visualizer.model.visual_model import VisualShape

SEGMENTS = 40  # of a circle


@dataclass(frozen=True)
class ShadedMesh:
    """Vertices (n, 3) in m, unit normals (n, 3), triangles (m, 3) counter-clockwise from outside."""

    vertices: Array
    normals: Array
    triangles: npt.NDArray[np.uint32]


def primitive_mesh(shape: VisualShape, margin: float = 0.0) -> ShadedMesh:
    """The mesh of a primitive, every surface moved out by `margin` [m]."""
    match shape.kind:
        case "box":
            return _box(np.array(shape.size) / 2.0 + margin)
        case "cylinder":
            radius, length = shape.size
            return _revolved(_cylinder_profile(radius + margin, length / 2.0 + margin))
        case "sphere":
            return _revolved(_sphere_profile(shape.size[0] + margin))
        case _:
            raise ValueError(f"a {shape.kind} is not a primitive")


def _box(half: Array) -> ShadedMesh:
    vertices: list[Array] = []
    normals: list[Array] = []
    triangles: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            u, v = np.roll(np.abs(normal), 1), np.roll(np.abs(normal), 2) * sign
            first = len(vertices)
            vertices += [(normal + a * u + b * v) * half for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            normals += [normal] * 4
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return ShadedMesh(np.array(vertices), np.array(normals), np.array(triangles, dtype=np.uint32))


def _cylinder_profile(radius: float, half: float) -> Array:
    """Rows (radius, z, normal's radial part, normal's z part) from bottom to top; edges stay sharp."""
    return np.array(
        [
            (0.0, -half, 0.0, -1.0), (radius, -half, 0.0, -1.0),
            (radius, -half, 1.0, 0.0), (radius, half, 1.0, 0.0),
            (radius, half, 0.0, 1.0), (0.0, half, 0.0, 1.0),
        ]
    )  # fmt: skip


def _sphere_profile(radius: float) -> Array:
    angles = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
    across, up = np.cos(angles), np.sin(angles)
    return np.stack([radius * across, radius * up, across, up], axis=1)


def _revolved(profile: Array) -> ShadedMesh:
    """The profile turned about z."""
    angles = np.linspace(0.0, 2.0 * np.pi, SEGMENTS + 1)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vertices, normals = (
        np.concatenate([np.column_stack([circle * row[column], np.full(len(circle), row[column + 1])])
                        for row in profile])
        for column in (0, 2)
    )  # fmt: skip
    ring = len(circle)
    corners = [(row * ring + k, row * ring + k + 1) for row in range(len(profile) - 1) for k in range(SEGMENTS)]
    triangles = [triangle for a, b in corners for triangle in ((a, b, b + ring), (a, b + ring, a + ring))]
    return ShadedMesh(vertices, normals, np.array(triangles, dtype=np.uint32))
