"""The spheres of the links, of convex solids and of meshes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.services.planner.collision_geometry.link_shapes import hull_mesh, link_shapes
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind
from gemelo.services.planner.collision_geometry.solids import Box, Capsule, ConvexSolid, Cylinder, polytope_around
from gemelo.services.planner.native.sphere_cover import (
    MOST_SPHERES,
    CompiledPolytope,
    cover_of,
    cover_shapes,
    link_cover,
    mesh_cover,
)
from tests.planner.native.conftest import load
from tests.planner.native.scenes import star_mesh
from tests.profiles import count, examples

HAIR = 1e-9  # [m]


def inside(solid: ConvexSolid, count: int, seed: int = 0) -> np.ndarray:
    """Points of the solid, most of them on its surface: what lies around it, brought to it."""
    rng = np.random.default_rng(seed)
    around = rng.uniform(-1.3, 1.3, (count, 3)) * solid.half
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 2.0 * solid.half
    return solid.nearest(np.vstack((around, corners)))


def sticks_out(points: np.ndarray, spheres: np.ndarray) -> float:
    """[m] by how much the worst point is outside of all spheres."""
    worst = -np.inf
    for some in np.array_split(points, max(1, len(points) // 500)):
        away = np.linalg.norm(some[:, None, :] - spheres[None, :, :3], axis=2) - spheres[None, :, 3]
        worst = max(worst, float(away.min(axis=1).max()))
    return worst


def directions(count: int) -> np.ndarray:
    """(count, 3) of length 1."""
    some = np.random.default_rng(1).normal(size=(count, 3))
    return some / np.linalg.norm(some, axis=1)[:, None]


sizes = st.floats(0.004, 0.08)
solids = st.one_of(
    st.builds(lambda x, y, z: Box((x, y, z)), sizes, sizes, sizes),
    st.builds(Cylinder, sizes, sizes),
    st.builds(Capsule, sizes, st.one_of(st.just(0.0), sizes)),
)


@examples(quick=10, full=40)
@given(solid=solids, bulge=st.floats(0.006, 0.02))
def test_every_point_of_a_solid_is_in_a_sphere_and_no_sphere_bulges_more_than_reported(solid, bulge):
    cover = cover_of(solid, bulge)
    assert sticks_out(inside(solid, 3000), cover.spheres) <= HAIR
    assert cover.bulge <= bulge + HAIR
    skin = cover.spheres[:, None, :3] + cover.spheres[:, None, 3:] * directions(200)[None, :, :]
    assert -solid.depth(skin).min() <= cover.bulge + HAIR


def test_a_ball_is_its_own_sphere():
    assert cover_of(Capsule(0.03, 0.0)).spheres.tolist() == [[0.0, 0.0, 0.0, 0.03]]


def test_the_same_solid_gets_the_same_spheres():
    box = Box((0.05, 0.02, 0.03))
    assert np.array_equal(cover_of(box, 0.005).spheres, cover_of(box, 0.005).spheres)


def test_a_smaller_bulge_takes_more_spheres():
    box = Box((0.05, 0.02, 0.03))
    assert len(cover_of(box, 0.003).spheres) > len(cover_of(box, 0.006).spheres) > len(cover_of(box, 0.012).spheres)


@pytest.mark.scaled
@pytest.mark.parametrize(("name", "links", "most"), [("rm1", 4, 2000), ("parol6", 7, 2600)])
def test_every_link_of_the_arms_is_covered(name, links, most):
    shapes = link_shapes(load(name))
    assert len(shapes) == links
    total = 0
    for several in shapes.values():
        cover = cover_shapes(several, 0.005)
        total += len(cover.spheres)
        assert 0.0 < cover.bulge <= 0.005 + HAIR
        for shape in several:
            solid = {"box": lambda s: Box(tuple(0.5 * x for x in s)), "cylinder": lambda s: Cylinder(s[0], 0.5 * s[1])}
            points = inside(solid[shape.kind](shape.size), count(quick=500, full=4000))
            assert sticks_out(points @ shape.rotation.T + shape.pose[0], cover.spheres) <= HAIR
    assert 0 < total <= most


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_links_of_few_spheres_bulge_no_more_than_was_asked_for(name):
    for several in link_shapes(load(name)).values():
        assert np.array_equal(link_cover(several, 0.005).spheres, cover_shapes(several, 0.005).spheres)


@pytest.mark.full
def test_a_large_link_of_many_shapes_bulges_more_and_has_no_more_spheres_than_are_sensible():
    """As the base of an industrial arm that is fitted with slices: 12,000 spheres that bulge 5 mm."""
    slices = [
        CollisionShape("slice", ShapeKind.BOX, (0.6, 0.05, 0.7), ((0.0, y, 0.0), (0.0, 0.0, 0.0, 1.0)))
        for y in np.linspace(-0.3, 0.3, 13)
    ]
    cover = link_cover(slices, 0.005)
    assert 0.3 * MOST_SPHERES < len(cover.spheres) < 1.5 * MOST_SPHERES
    for each in slices:
        assert sticks_out(inside(Box((0.3, 0.025, 0.35)), 400) + each.pose[0], cover.spheres) <= HAIR


@pytest.mark.scaled
def test_a_mesh_is_covered_inside_too():
    mesh = star_mesh(np.random.default_rng(3))
    cover = mesh_cover(*mesh.arrays, 0.006)
    vertices, faces = mesh.arrays
    shares = np.random.default_rng(4).dirichlet((1.0, 1.0, 1.0), (40, len(faces)))
    surface = np.einsum("sfk,fkx->sfx", shares, vertices[faces]).reshape(-1, 3)
    depths = np.random.default_rng(5).random((len(surface), 1))
    points = np.vstack((surface, surface * depths))  # the star is seen whole from its middle
    assert sticks_out(points[:: count(quick=5, full=1)], cover.spheres) <= HAIR
    spacing = 0.008  # [m] between these points, about
    skin = (cover.spheres[:, None, :3] + cover.spheres[:, None, 3:] * directions(8)[None, :, :]).reshape(-1, 3)
    assert sticks_out(skin[:400], np.column_stack((points, np.zeros(len(points))))) <= cover.bulge + spacing


def test_what_has_no_end_cannot_be_covered():
    with pytest.raises(ValueError, match=r'"floor": a half_space has no end'):
        cover_shapes([CollisionShape("floor", ShapeKind.HALF_SPACE)], 0.005)


def test_a_long_mesh_has_about_as_few_spheres_as_a_cylinder_and_bulges_less_than_a_fortieth_of_its_length():
    angles = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
    ring = np.column_stack((0.05 * np.cos(angles), 0.05 * np.sin(angles)))
    ends = [np.column_stack((ring, np.full(32, height))) for height in (-0.3, 0.3)]
    vertices = np.vstack((*ends, [[0.0, 0.0, -0.3], [0.0, 0.0, 0.3]]))
    around = [((i + 1) % 32, i) for i in range(32)]
    faces = [
        face for i, j in around for face in ((j, i, 32 + i), (j, 32 + i, 32 + j), (64, i, j), (65, 32 + j, 32 + i))
    ]
    cover = mesh_cover(vertices, np.array(faces, dtype=np.int32), 0.005)
    assert cover.bulge < 0.6 / 40.0
    assert len(cover.spheres) < 2 * len(cover_of(Cylinder(0.05, 0.3), 0.005).spheres)


@pytest.mark.parametrize("seed", range(4))
def test_compiled_a_polytope_is_the_same_solid_as_in_python(seed: int):
    random = np.random.default_rng(seed)
    polytope = polytope_around(hull_mesh(random.normal(scale=0.1, size=(20 + 60 * seed, 3))))
    compiled, points = CompiledPolytope(polytope), random.normal(scale=0.15, size=(7, 31, 3))
    assert np.allclose(compiled.depth(points), polytope.depth(points), atol=1e-15)
    assert (compiled.depth(points) < 0.0).any()
    assert (compiled.depth(points) > 0.0).any()
    assert np.allclose(compiled.nearest(points), polytope.nearest(points), atol=1e-12)
    assert np.array_equal(compiled.half, polytope.half)
