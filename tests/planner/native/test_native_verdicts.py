""" "Free" is never wrong: against coal on the links' own geometry, among obstacles of every kind."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gemelo.services.planner.collision_geometry.shapes import Attachment, CollisionShape, ShapeKind, TriangleMesh
from gemelo.services.planner.native.native_planner import ContactPair, NativePlanner
from tests.planner.native.coal_truth import Truth
from tests.planner.native.conftest import load
from tests.planner.native.scenes import box_mesh, random_shape
from tests.profiles import count

BULGE = 0.005  # [m]
UNSURE = 1e-5  # [m] of coal's own distances


@pytest.mark.scaled
def test_no_configuration_is_free_that_touches_itself(arm, core, configurations):
    rows, truth = configurations(count(quick=600, full=3000), 1), Truth(arm)
    distances = np.array([truth.distance(row) for row in rows])
    free = core.free(rows)
    assert distances[free].min() > core.margin - UNSURE
    assert distances[~free].max() < core.margin + BULGE + 1e-3


@pytest.mark.scaled
@pytest.mark.parametrize("kind", list(ShapeKind))
def test_no_configuration_is_free_that_touches_an_obstacle(kind, arm, core, configurations):
    rng = np.random.default_rng(7)
    touching = 0
    for round_ in range(count(quick=2, full=6)):
        scene = [random_shape(rng, kind, f"{kind} {i}") for i in range(1 if kind is ShapeKind.HALF_SPACE else 3)]
        core.set_scene(scene)
        truth, rows = Truth(arm, scene), configurations(150, round_)
        distances = np.array([truth.distance(row) for row in rows])
        free = core.free(rows)
        touching += int((~free).sum())
        assert not free.any() or distances[free].min() > core.margin - UNSURE
        if kind is not ShapeKind.MESH:  # coal knows a mesh's skin only, ours is solid
            assert free.all() or distances[~free].max() < core.margin + BULGE + 1e-3
    assert touching > 0


def test_the_distance_is_never_more_than_the_true_one_and_never_much_less(arm, core, configurations):
    scene = [random_shape(np.random.default_rng(11 + i), kind, kind) for i, kind in enumerate(ShapeKind)]
    core.set_scene(scene)
    truth = Truth(arm, scene)
    for row in configurations(200, 12):
        told, real = core.distance(row), truth.distance(row)
        assert told <= max(real, 0.0) + UNSURE
        assert told == 0.0 or real < told + BULGE + 1e-3


def test_a_contact_bears_the_names_of_both():
    core = NativePlanner(load("rm1"))
    core.set_scene([CollisionShape("far", ShapeKind.SPHERE, (0.01,), ((2.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))])
    home = [0.0, 0.0, 0.1]
    assert core.first_contact(home) is None
    assert core.nearest(home, most=0.001) is None
    core.set_scene([CollisionShape("crate", ShapeKind.BOX, (0.1, 0.1, 0.1), ((0.4, 0.0, 0.07), (0.0, 0.0, 0.0, 1.0)))])
    assert core.first_contact(home) == ContactPair("efector_link", "crate")
    low = [0.0, math.pi - 0.2, 0.0]
    core.set_scene([])
    assert core.first_contact(low) in (
        ContactPair("efector_link", "base_link"),
        ContactPair("efector_link", "brazo_link"),
    )


def test_the_nearest_is_named_before_it_is_touched():
    core = NativePlanner(load("rm1"))
    core.set_scene([CollisionShape("post", ShapeKind.CYLINDER, (0.02, 0.5), ((0.5, 0.0, 0.25), (0.0, 0.0, 0.0, 1.0)))])
    home = [0.0, 0.0, 0.1]
    assert core.nearest(home) == ContactPair("efector_link", "post")
    assert 0.05 < core.distance(home) < 0.08


def test_an_obstacle_may_be_touched_by_the_links_it_names():
    core = NativePlanner(load("rm1"))
    place = ((0.4, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0))
    home = [[0.0, 0.0, 0.1]]
    core.set_scene([CollisionShape("crate", ShapeKind.BOX, (0.05, 0.05, 0.05), place)])
    assert not core.free(home)[0]
    core.set_scene(
        [CollisionShape("crate", ShapeKind.BOX, (0.05, 0.05, 0.05), place, touching=frozenset({"efector_link"}))]
    )
    assert core.free(home)[0]


def test_padding_keeps_the_arm_farther_away():
    core = NativePlanner(load("rm1"))
    home = [[0.0, 0.0, 0.1]]
    place = ((0.5, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))
    core.set_scene([CollisionShape("ball", ShapeKind.SPHERE, (0.05,), place)])
    assert core.free(home)[0]
    core.set_scene([CollisionShape("ball", ShapeKind.SPHERE, (0.05,), place, padding=0.05)])
    assert not core.free(home)[0]


def test_the_inside_of_a_closed_mesh_is_solid_and_that_of_an_open_one_is_not():
    core = NativePlanner(load("rm1"))
    room = box_mesh(np.random.default_rng(0))
    room = TriangleMesh(
        room.vertices / np.abs(room.vertices).max(axis=0), room.faces
    )  # 2 m wide: all of the arm is in it
    middle = ((0.0, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0))
    home = [[0.0, 0.0, 0.1]]
    core.set_scene([CollisionShape("rock", ShapeKind.MESH, (), middle, room)])
    assert not core.free(home)[0]
    core.set_scene([CollisionShape("room", ShapeKind.MESH, (), middle, TriangleMesh(room.vertices, room.faces[2:]))])
    assert core.free(home)[0]


def test_a_held_box_is_part_of_the_arm():
    core = NativePlanner(load("rm1"))
    wall = CollisionShape("wall", ShapeKind.BOX, (0.02, 1.0, 1.0), ((0.48, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0)))
    core.set_scene([wall])
    home = [[0.0, 0.0, 0.15]]
    assert core.free(home)[0]
    held = CollisionShape("box", ShapeKind.BOX, (0.12, 0.04, 0.04), ((0.05, 0.0, 0.02), (0.0, 0.0, 0.0, 1.0)))
    core.attach(Attachment("box", "efector_link", (held,), frozenset({"antebrazo_link"})))
    assert core.first_contact(home[0]) == ContactPair("box", "wall")
    core.set_scene([])
    assert core.free(home)[0]
    core.detach("box")
    core.set_scene([wall])
    assert core.free(home)[0]


def test_a_held_box_must_not_touch_the_arm_that_holds_it():
    core = NativePlanner(load("rm1"))
    beam = CollisionShape("beam", ShapeKind.BOX, (0.4, 0.03, 0.03), ((-0.2, 0.0, -0.16), (0.0, 0.0, 0.0, 1.0)))
    core.attach(Attachment("beam", "efector_link", (beam,), frozenset()))
    assert core.first_contact([0.0, 0.0, 0.0]) is not None


def test_padding_and_touching_and_names_are_checked():
    core = NativePlanner(load("rm1"))
    ball = CollisionShape("ball", ShapeKind.SPHERE, (0.05,))
    with pytest.raises(ValueError, match=r'"ball" twice'):
        core.set_scene([ball, ball])
    with pytest.raises(ValueError, match=r'"elbow" is neither a link'):
        core.set_scene([CollisionShape("ball", ShapeKind.SPHERE, (0.05,), touching=frozenset({"elbow"}))])
    with pytest.raises(ValueError, match=r"a box has 3 sizes above 0 m"):
        CollisionShape("crate", ShapeKind.BOX, (0.1, 0.1, -0.1))
    with pytest.raises(ValueError, match=r"its pose is not finite"):
        CollisionShape("ball", ShapeKind.SPHERE, (0.05,), ((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    with pytest.raises(ValueError, match=r'no link "hand"'):
        core.attach(Attachment("ball", "hand", (ball,)))
    with pytest.raises(ValueError, match=r'nothing called "ball" is attached'):
        core.detach("ball")
    assert core.free([[0.0, 0.0, 0.1]])[0]  # the scene is as it was before all that


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e9])
def test_joint_values_that_nobody_can_mean_are_refused(bad):
    core = NativePlanner(load("rm1"))
    for ask in (lambda q: core.free([q]), core.distance, core.first_contact, lambda q: core.edge_free(q, q)):
        with pytest.raises(ValueError, match=r"is not within 100 rad or m of 0"):
            ask([0.0, bad, 0.0])


def test_wrong_shapes_of_arrays_are_refused():
    core = NativePlanner(load("rm1"))
    with pytest.raises(ValueError, match=r"3 columns, not 4"):
        core.free(np.zeros((2, 4)))
    with pytest.raises(ValueError, match=r"\(rows, 3\)"):
        core.free(np.zeros(3))
    with pytest.raises(ValueError, match=r"\(3,\)"):
        core.distance(np.zeros((1, 3)))
    assert core.free(np.zeros((0, 3))).shape == (0,)


@pytest.mark.full
def test_a_mesh_of_a_hundred_thousand_triangles_is_built_and_asked():
    from tests.planner.native.scenes import star_mesh

    core = NativePlanner(load("rm1"))
    mesh = star_mesh(np.random.default_rng(1), rings=224, sectors=224)
    assert len(mesh.faces) > 99_000
    core.set_scene([CollisionShape("rock", ShapeKind.MESH, (), ((0.3, 0.1, 0.1), (0.0, 0.0, 0.0, 1.0)), mesh)])
    rows = np.random.default_rng(2).uniform([-2.9, -2.9, 0.0], [2.9, 2.9, 0.2], (200, 3))
    free = core.free(rows)
    assert 0 < free.sum() < len(rows)
