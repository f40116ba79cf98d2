"""A mesh as the fit sees it: its triangles by body, places spread over its surface, what is near and what is inside."""

from __future__ import annotations

from functools import lru_cache

import coal
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gemelo.services.planner.collision_geometry.coal_shapes import is_inside, tree_of
from gemelo.services.planner.collision_geometry.shapes import TriangleMesh
from gemelo.tools.collision_fitting.openings import closed, places_numbered

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
SPACING = 0.002  # [m] between places on the surface, where that makes neither fewer nor more than
FEWEST, MOST = 2000, 12000
POINT = 1e-9  # [m] radius of a ball that stands for a point
NEAREST = 4  # places whose triangles are looked at for a distance
CLOSED = 1e-6  # of its area, that the sum of a closed body's normals is off zero at most


class MeshSurface:
    """`corners` (f, 3, 3) [m] of the triangles, with the lids of openings, and `body` (f,) that each belongs to: bodies
    touch nowhere.

    Bodies that are not closed are one: they may bound a solid together.
    """

    def __init__(self, drawn: TriangleMesh) -> None:
        mesh = closed(drawn)
        self._boxes = tree_of(mesh)
        self.corners: Array = mesh.vertices[mesh.faces]
        self.body = _bodies(mesh, self.corners)
        whole = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        count = int(np.clip(whole.area / SPACING**2, FEWEST, MOST))
        places, faces = trimesh.sample.sample_surface(whole, count, seed=0)
        self.places = np.vstack((places, self.corners.mean(axis=1)))
        self._of = np.concatenate((faces, np.arange(len(self.corners))))
        self._tree = cKDTree(self.places)
        corners = self.corners.reshape(-1, 3)[:: max(1, 3 * len(self.corners) // MOST)]
        self.spread = np.vstack((self.places[: len(places)], corners))
        self.spread_body = np.concatenate(
            (self.body[faces], np.repeat(self.body, 3)[:: max(1, 3 * len(self.body) // MOST)])
        )
        self._inside = lru_cache(maxsize=4096)(self._find_inside)

    def near_distances(self, points: Array) -> Array:
        """(n,) [m] from points (n, 3) to the nearest place: some `SPACING` more than to the surface at most."""
        distances: Array = self._tree.query(points)[0]
        return distances

    def distances(self, points: Array) -> Array:
        """(n,) [m] from points (n, 3) to the surface: exact where one of the nearest places is on the nearest triangle,
        else a little more."""
        _, found = self._tree.query(points, k=NEAREST)
        best = np.full(len(points), np.inf)
        for column in found.T:
            nearest = trimesh.triangles.closest_point(self.corners[self._of[column]], points)
            best = np.minimum(best, np.linalg.norm(nearest - points, axis=1))
        return best

    def exact_distances(self, points: Array) -> Array:
        """(n,) [m] from points (n, 3) to the surface; some 30 us each."""
        ball, there = coal.Sphere(POINT), coal.Transform3s()
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        distances = np.empty(len(points))
        for index, point in enumerate(points):
            result.clear()
            pose = coal.Transform3s(np.eye(3), point)
            distances[index] = coal.distance(self._boxes, there, ball, pose, request, result)
        return np.maximum(distances + POINT, 0.0)

    def inside(self, points: Array, bodies: Numbers) -> NDArray[np.bool_]:
        """(n,) True for each of points (n, 3) [m] that one of the `bodies` encloses."""
        return np.array([any(self._inside(tuple(point), int(body)) for body in bodies) for point in points], dtype=bool)

    def _find_inside(self, point: tuple[float, ...], body: int) -> bool:
        corners = self.corners[self.body == body]
        faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
        return is_inside(TriangleMesh(corners.reshape(-1, 3), faces), np.array(point))


def _bodies(mesh: TriangleMesh, corners: Array) -> Numbers:
    """(f,) numbers; corners at one place are one, whatever normals they have in the file."""
    numbers, count = places_numbered(mesh.vertices)
    faces = numbers[mesh.faces]
    labels = trimesh.graph.connected_component_labels(faces[:, [[0, 1], [1, 2]]].reshape(-1, 2), count)
    body = np.unique(labels[faces[:, 0]], return_inverse=True)[1]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.bincount(body, np.linalg.norm(normals, axis=1))
    off = np.linalg.norm([np.bincount(body, normals[:, axis]) for axis in range(3)], axis=0)
    is_open = off > CLOSED * areas
    if is_open.any():
        body = np.where(is_open[body], int(np.argmax(is_open)), body)
    return np.asarray(body, dtype=np.int64)
