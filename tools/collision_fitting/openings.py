"""A mesh as the surface of a solid: each triangle once, and a lid on each flat opening.

Meshes that are made for the eye lack the faces that other parts hide: a wrist is a cup whose bottom is on the forearm.
What is behind an opening belongs to the link as far as its shapes go; without a lid they would be cut until they follow
the inner side of the cup.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import trimesh
from numpy.typing import NDArray

from gemelo.services.planner.collision_geometry.shapes import TriangleMesh

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
SAME = 1e-9  # [m] between places that are not told apart
MOST_OPEN = 0.25  # of all edges, that belong to one triangle: with more it is no surface with openings, but many pieces
UNEVEN = 0.02  # of the longest side of an opening, that its edge is off a plane at most
SEAM = 1e-4  # [m] between the edges of two pieces of one surface
SEAM_SHARE = 0.5  # of an edge's corners, that are on a seam: it is no opening


def places_numbered(points: Array) -> tuple[Numbers, int]:
    """(n,) a number for each of points (n, 3) [m], the same for those at one place, and how many there are."""
    keys = np.round(points / SAME).astype(np.int64)
    order = np.lexsort(keys.T)
    is_new = np.concatenate(([True], (np.diff(keys[order], axis=0) != 0).any(axis=1)))
    numbers = np.empty(len(keys), dtype=np.int64)
    numbers[order] = np.cumsum(is_new) - 1
    return numbers, int(is_new.sum())


def closed(mesh: TriangleMesh) -> TriangleMesh:
    """Without triangles that are there twice, as surfaces with a front and a back have them, and with the lids."""
    numbers, count = places_numbered(mesh.vertices)
    vertices = np.empty((count, 3))
    vertices[numbers] = mesh.vertices
    faces = numbers[mesh.faces]
    faces = faces[np.sort(np.unique(_numbered(np.sort(faces, axis=1), count), return_index=True)[1])]
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    _, first, uses = np.unique(_numbered(edges, count), return_index=True, return_counts=True)
    single = edges[first[uses == 1]]
    if not 0 < len(single) <= MOST_OPEN * len(uses):
        return TriangleMesh(vertices, faces.astype(np.int32))
    for opening in _openings(vertices, single):
        lid = np.column_stack((opening, np.full(len(opening), len(vertices))))
        vertices = np.vstack((vertices, vertices[np.unique(opening)].mean(axis=0)))
        faces = np.vstack((faces, lid))
    return TriangleMesh(vertices, faces.astype(np.int32))


def _numbered(rows: Numbers, count: int) -> Numbers:
    """(n,) one number for each of rows (n, k) of numbers below `count`, in their order: a fraction of what np.unique of
    rows takes. Three of two million are below 2^63."""
    return np.asarray(rows @ (np.int64(count) ** np.arange(rows.shape[1])[::-1]))


def _openings(vertices: Array, single: Numbers) -> Iterator[Numbers]:
    """The edges (k, 2) around each flat opening, of `single` edges (n, 2) between vertices (v, 3) [m]."""
    labels = trimesh.graph.connected_component_labels(single, len(vertices))[single[:, 0]]
    for label in np.unique(labels):
        mine, others = single[labels == label], single[labels != label]
        corners, meeting = np.unique(mine, return_counts=True)
        points = vertices[corners]
        axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
        extents = np.ptp(points @ axes.T, axis=0) if len(points) > 3 else np.zeros(3)
        if (meeting % 2 == 0).all() and extents.min() <= UNEVEN * extents.max():
            on_seam = _distances(points, vertices[others]) < SEAM
            if on_seam.mean() < SEAM_SHARE:
                yield mine


def _distances(points: Array, edges: Array) -> Array:
    """(n,) [m] from points (n, 3) to the nearest of edges (k, 2, 3), infinite where none is near any of them."""
    best = np.full(len(points), np.inf)
    low, high = points.min(axis=0) - SEAM, points.max(axis=0) + SEAM
    near = (edges.max(axis=1) >= low).all(axis=1) & (edges.min(axis=1) <= high).all(axis=1)
    for start, end in edges[near]:
        along = end - start
        share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - start - share[:, None] * along, axis=1))
    return best
