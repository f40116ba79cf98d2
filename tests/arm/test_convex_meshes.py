"""Collision meshes that are convex become coal's convex shapes; whatever is not keeps its triangles."""

from __future__ import annotations

import coal
import numpy as np
import pytest
import trimesh

from gemelo.libraries.arm.kinematics.convex_meshes import MOST_TRIANGLES, convex_or_same, corners_of

BOX = trimesh.creation.box((0.1, 0.2, 0.3))


def tree(mesh: trimesh.Trimesh) -> coal.BVHModelOBBRSS:
    made = coal.BVHModelOBBRSS()
    made.beginModel(len(mesh.faces), len(mesh.vertices))
    made.addVertices(np.array(mesh.vertices))
    made.addTriangles(np.array(mesh.faces, dtype=np.int64))
    made.endModel()
    return made


def distance(geometry: coal.CollisionGeometry, point: tuple[float, float, float]) -> float:
    """[m] of a ball of 1 cm at `point`."""
    pose, request, result = coal.Transform3s(np.eye(3), np.array(point)), coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(geometry, coal.Transform3s(), coal.Sphere(0.01), pose, request, result))


@pytest.mark.parametrize(
    "mesh", [BOX, trimesh.creation.cylinder(0.05, 0.3, sections=24), trimesh.creation.icosphere(2)]
)
def test_a_convex_mesh_is_as_far_from_everything_as_its_triangles_are(mesh: trimesh.Trimesh):
    same = convex_or_same(tree(mesh))
    assert isinstance(same, coal.Convex)
    assert {*map(tuple, corners_of(same))} <= {*map(tuple, np.array(mesh.vertices))}
    for point in np.random.default_rng(0).uniform(1.2, 2.0, (20, 3)):
        assert distance(same, point) == pytest.approx(distance(tree(mesh), point), abs=1e-6)


def test_what_is_inside_a_convex_mesh_touches_it():
    """Of triangles coal knows the skin only."""
    assert distance(tree(BOX), (0.0, 0.0, 0.0)) > 0.0
    assert distance(convex_or_same(tree(BOX)), (0.0, 0.0, 0.0)) < 0.0


def test_a_mesh_with_a_bay_a_hole_no_volume_or_many_triangles_stays_as_it_is():
    bay = trimesh.boolean.difference([BOX, trimesh.creation.box((0.02, 0.3, 0.02))])
    hole = trimesh.Trimesh(BOX.vertices, BOX.faces[1:], process=False)
    flat = trimesh.Trimesh(BOX.vertices * (1.0, 1.0, 0.0), BOX.faces, process=False)
    many = trimesh.creation.icosphere(4)
    assert len(many.faces) > MOST_TRIANGLES
    for mesh in (bay, hole, flat, many):
        geometry = tree(mesh)
        assert convex_or_same(geometry) is geometry
    round_one = coal.Sphere(0.1)
    assert convex_or_same(round_one) is round_one
