"""Random obstacles of every kind within an arm's reach; the same ones for the same seed."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import Rigid
from gemelo.services.planner.collision_geometry.link_shapes import hull_mesh
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh

Array = NDArray[np.float64]
REACH = 0.5  # [m] of both arms, about


def random_pose(rng: np.random.Generator, reach: float = REACH) -> Rigid:
    turn = rng.normal(size=4)
    x, y, z, w = (turn / np.linalg.norm(turn)).tolist()
    place = rng.uniform([-reach, -reach, 0.0], [reach, reach, reach]).tolist()
    return (place[0], place[1], place[2]), (x, y, z, w)


def random_shape(rng: np.random.Generator, kind: ShapeKind, name: str) -> CollisionShape:
    if kind is ShapeKind.HALF_SPACE:
        return CollisionShape(name, kind, (), ((0.0, 0.0, -0.05 - 0.2 * rng.random()), _leaning(rng)))
    if kind is ShapeKind.MESH:
        return CollisionShape(name, kind, (), random_pose(rng), rng.choice([box_mesh, star_mesh])(rng))
    if kind is ShapeKind.HULL:
        return CollisionShape(name, kind, (), random_pose(rng), hull_mesh(rng.uniform(-0.1, 0.1, (12, 3))))
    sizes = {ShapeKind.BOX: 3, ShapeKind.SPHERE: 1, ShapeKind.CYLINDER: 2, ShapeKind.CAPSULE: 2}[kind]
    return CollisionShape(name, kind, tuple(rng.uniform(0.02, 0.2, sizes).tolist()), random_pose(rng))


def _leaning(rng: np.random.Generator) -> tuple[float, float, float, float]:
    turn = np.array([*rng.normal(scale=0.05, size=2), 0.0, 1.0])
    x, y, z, w = (turn / np.linalg.norm(turn)).tolist()
    return x, y, z, w


def box_mesh(rng: np.random.Generator) -> TriangleMesh:
    """The surface of a box, outward."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * rng.uniform(0.02, 0.12, 3)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return TriangleMesh(corners, np.array(faces, dtype=np.int32))


def stl_of(mesh: TriangleMesh) -> bytes:
    """The mesh as a binary STL file."""
    facets = np.zeros(len(mesh.faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    facets["corners"] = mesh.vertices[mesh.faces]
    return bytes(80) + struct.pack("<I", len(facets)) + facets.tobytes()


def star_mesh(rng: np.random.Generator, rings: int = 8, sectors: int = 12) -> TriangleMesh:
    """A closed, dented ball: radii at random, so that it is not convex."""
    polar = np.linspace(0.0, np.pi, rings + 1)[1:-1]
    around = np.linspace(0.0, 2.0 * np.pi, sectors, endpoint=False)
    rows = [[np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)] for p in polar for a in around]
    directions = np.array([[0.0, 0.0, 1.0], *rows, [0.0, 0.0, -1.0]])
    last = len(directions) - 1
    faces = []
    for i in range(sectors):
        j = (i + 1) % sectors
        faces.append((0, 1 + i, 1 + j))
        faces.append((last, last - sectors + j, last - sectors + i))
        for ring in range(rings - 2):
            a, b = 1 + ring * sectors, 1 + (ring + 1) * sectors
            faces += [(a + i, b + i, b + j), (a + i, b + j, a + j)]
    vertices = directions * rng.uniform(0.04, 0.12, (len(directions), 1))
    return TriangleMesh(vertices, np.array(faces, dtype=np.int32))
