"""Solids by name and pose: what stands around the arm, what it holds, what it is made of."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid

Array = NDArray[np.float64]


class ShapeKind(StrEnum):
    """And what `CollisionShape.size` means for each, in m."""

    BOX = "box"  # x, y, z: whole lengths of the edges
    SPHERE = "sphere"  # radius
    CYLINDER = "cylinder"  # radius, length; along z
    CAPSULE = "capsule"  # radius, length of the straight part; along z
    HALF_SPACE = "half_space"  # nothing: solid where z <= 0
    MESH = "mesh"  # nothing
    HULL = "hull"  # nothing; solid is what the convex hull of its mesh holds


# Tuning constants: chosen, where a line does not say measured or standard.
SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "half_space": 0, "mesh": 0, "hull": 0}


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles: `vertices` (v, 3) [m], `faces` (f, 3) vertex numbers. Solid where the surface is closed."""

    vertices: Array
    faces: NDArray[np.int32]

    @property
    def arrays(self) -> tuple[Array, NDArray[np.int32]]:
        """Vertices (v, 3) [m] and faces (f, 3) as contiguous arrays for the native planner; raises ValueError for a
        vertex that is not finite."""
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        if not np.isfinite(vertices).all():
            raise ValueError("a vertex of the mesh is not finite")
        return vertices, np.ascontiguousarray(self.faces, dtype=np.int32)


@dataclass(frozen=True)
class CollisionShape:
    """One solid; `pose` is in the arm's base, or in the link that it belongs to."""

    name: str
    kind: ShapeKind
    size: tuple[float, ...] = ()
    pose: Rigid = IDENTITY
    mesh: TriangleMesh | None = None
    padding: float = 0.0  # [m] added on all sides
    touching: frozenset[str] = frozenset()  # links and attached things that may touch it

    def __post_init__(self) -> None:
        wanted = SIZES[self.kind]
        is_sized = min(self.size, default=1.0) > 0.0 and math.isfinite(sum(self.size))
        if len(self.size) != wanted or not is_sized:
            raise ValueError(f'"{self.name}": a {self.kind} has {wanted} sizes above 0 m, not {self.size}')
        if (self.kind in (ShapeKind.MESH, ShapeKind.HULL)) != (self.mesh is not None):
            raise ValueError(f'"{self.name}": a mesh or hull, and nothing else, comes with its triangles')
        if not 0.0 <= self.padding < math.inf:
            raise ValueError(f'"{self.name}": padding must be 0 m or more, not {self.padding}')
        if not math.isfinite(sum(map(sum, self.pose))):
            raise ValueError(f'"{self.name}": its pose is not finite')
        if abs(math.hypot(*self.pose[1]) - 1.0) > 1e-3:
            raise ValueError(f'"{self.name}": its rotation is no unit quaternion (x, y, z, w)')

    @cached_property
    def matrix(self) -> Array:
        """The pose as a homogeneous transform (4, 4), translation in [m], with its quaternion brought to length 1; not
        to be written to."""
        matrix = matrix_of(self.pose)
        matrix.flags.writeable = False
        return matrix

    @property
    def rotation(self) -> Array:
        """The rotation matrix (3, 3) of the pose."""
        return self.matrix[:3, :3]


def matrix_of(pose: Rigid) -> Array:
    """The homogeneous transform (4, 4), translation in [m], of a translation and a quaternion of any length but 0."""
    length = math.hypot(*pose[1])
    x, y, z, w = (value / length for value in pose[1])
    a, b, c = pose[0]
    return np.array(
        (
            1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), a,
            2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), b,
            2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), c,
            0.0, 0.0, 0.0, 1.0,
        )
    ).reshape(4, 4)  # fmt: skip


@dataclass(frozen=True)
class Attachment:
    """Shapes that move with a link, their poses in it; `touching` links may be touched by them."""

    name: str
    link: str
    shapes: tuple[CollisionShape, ...]
    touching: frozenset[str] = frozenset()
