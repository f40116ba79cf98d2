"""Convex hulls as coal makes them: the same solids as scipy's, which takes as long to load as the rest of a planner."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from gemelo.services.planner.collision_geometry.link_shapes import hull_mesh
from gemelo.services.planner.collision_geometry.solids import polytope_around
from gemelo.tools.bench.any_arm.generated_arms import generated_arm

STEPS = np.linspace(-0.05, 0.05, 6)
LATTICE = np.stack(np.meshgrid(STEPS, STEPS, STEPS), axis=-1).reshape(-1, 3)
CYLINDER = np.array(trimesh.creation.cylinder(0.03, 0.4, sections=90).vertices)
NEEDLE = np.array([(0.0, 0.0, 0.0), (1.0, 1e-9, 0.0), (0.5, 0.0, 1e-3), (0.5, 1e-3, 0.0), (1.0, 0.0, 0.0)])


@pytest.mark.parametrize(
    "points",
    [np.random.default_rng(seed).normal(scale=0.1, size=(30 + 90 * seed, 3)) for seed in range(3)]
    + [LATTICE, CYLINDER, CYLINDER + 7.0, NEEDLE],
    ids=["few", "more", "many", "lattice", "cylinder", "far away", "needle"],
)
def test_a_hull_is_the_same_solid_as_scipys(points: np.ndarray):
    mesh = hull_mesh(points)
    own, planes = polytope_around(mesh), ConvexHull(points).equations
    around = points.mean(axis=0) + np.random.default_rng(9).normal(scale=np.ptp(points, axis=0), size=(500, 3))
    depths = (-planes[:, 3] - around @ planes[:, :3].T).min(axis=1)
    least = 0.0 if points is NEEDLE else -np.inf  # the side of its end is left out: that far outside nobody asks
    assert np.allclose(np.maximum(own.depth(around), least), np.maximum(depths, least), atol=1e-8)
    assert own.depth(points).min() > -1e-12
    corners = mesh.vertices[mesh.faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0] - points.mean(axis=0), np.cross(corners[:, 1], corners[:, 2]))
    assert volumes.sum() > 0.0  # turned outwards
    edges = {(a, b) for row in mesh.faces.tolist() for a, b in zip(row, row[1:] + row[:1], strict=True)}
    assert all((b, a) in edges for a, b in edges)


@pytest.mark.parametrize(
    "points", [np.zeros((3, 3)), np.ones((9, 3)), LATTICE * (1.0, 1.0, 0.0), np.full((8, 3), np.nan)]
)
def test_points_without_a_volume_have_no_hull_and_end_no_process(points: np.ndarray):
    with pytest.raises(ValueError, match="no convex hull"):
        hull_mesh(points)


def test_an_arm_of_hulls_is_planned_for_without_scipys_geometry():
    """`scipy.spatial` took half of the time to the first plan, in every worker."""
    folder = generated_arm("six_mesh").folder
    words = (
        "import sys; from gemelo.libraries.arm.model.description import load_arm; "
        "from gemelo.services.planner.core import Planner; "
        f"planner = Planner(load_arm({str(folder)!r})); planner.prepare(); "
        "print(planner.checker.native(0.004) is not None, 'scipy.spatial' in sys.modules)"
    )
    said = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True, timeout=120)
    assert said.stdout.split() == ["True", "False"]
