"""The mesh that plans go around in `plan_mesh_ms`."""

from __future__ import annotations

from collections import Counter

import numpy as np

from gemelo.tools.bench.planner.mesh_planning import DENTS, RADIUS, dented_ball, triangles


def test_the_rock_has_a_hundred_thousand_triangles_and_is_closed():
    content = dented_ball().shape.data
    facets = np.frombuffer(content[84:], dtype=[("n", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    corners = facets["corners"]
    assert len(corners) == triangles() >= 100_000
    radii = np.linalg.norm(corners, axis=2)
    assert RADIUS - 1.01 * DENTS <= radii.min() < radii.max() <= RADIUS + 1.01 * DENTS
    names = {}
    rows = np.array([[names.setdefault(tuple(p), len(names)) for p in triangle] for triangle in corners.tolist()])
    assert all(len(set(row)) == 3 for row in rows.tolist())
    edges = Counter((a, b) for row in rows.tolist() for a, b in zip(row, [*row[1:], row[0]], strict=True))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)  # each once in either direction: closed, and turned one way
