"""Whole ways: nothing is skipped between samples, on straight lines and on curves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, CylinderShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.sphere_check import show_scene
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind
from gemelo.services.planner.native.native_planner import NativePlanner
from gemelo.services.planner.native.paths import Effort, FreePath
from tests.planner.native.coal_truth import Truth
from tests.planner.native.conftest import load
from tests.planner.native.scenes import random_shape
from tests.profiles import count

MARGIN = 1e-3  # [m]
UNSURE = 1e-5  # [m] of coal's own distances
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
TRIANGLES = (ShapeKind.MESH, ShapeKind.HULL)  # of these the compiled core knows the surface, and so less for sure


@pytest.mark.scaled
def test_no_line_is_free_that_touches_anything_between_its_ends(arm, core, configurations):
    rng = np.random.default_rng(21)
    refused = passed = 0
    for round_ in range(count(quick=2, full=4)):
        scene = [random_shape(rng, kind, kind) for kind in ShapeKind if kind not in TRIANGLES]
        core.set_scene(scene)
        truth, rows = Truth(arm, scene), configurations(60, round_)
        rows = rows[core.free(rows)]
        for start, goal in pairwise(rows):
            ways = start + np.linspace(0.0, 1.0, 40)[:, None] * (goal - start)
            if core.edge_free(start, goal):
                passed += 1
                assert min(truth.distance(row) for row in ways) > core.margin - UNSURE
            else:
                refused += 1
    assert min(refused, passed) > count(quick=2, full=5)


def test_a_refused_line_comes_within_the_margin_and_the_bulge(arm, core, configurations):
    rows = configurations(60, 5)
    rows = rows[core.free(rows)]
    for start, goal in pairwise(rows):
        if not core.edge_free(start, goal):
            ways = start + np.linspace(0.0, 1.0, 3000)[:, None] * (goal - start)
            assert not core.free(ways).all() or min(core.distance(row) for row in ways) < core.margin + 0.001


@pytest.mark.parametrize("count", [65, 200, 607])
def test_a_way_of_many_lines_is_free_where_each_part_of_it_is(arm, core, configurations, count):
    """Many lines are looked at eight together: uneven ones, and a rest of fewer than eight."""
    rng, found = np.random.default_rng(count), []
    for round_ in range(6):
        core.set_scene([random_shape(rng, kind, kind) for kind in ShapeKind if kind not in TRIANGLES])
        rows = configurations(80, round_)
        for start, goal in pairwise(rows[core.free(rows)]):
            shares = np.sort(rng.uniform(0.0, 1.0, count) ** 3)[:, None]
            bent = start + shares * (goal - start) + 0.1 * np.sin(7.0 * shares) * (goal - start)[::-1]
            is_free = core.path_free(bent)
            found.append(is_free)
            core.margin = (0.5 if is_free else 1.5) * MARGIN  # both are told apart to 0.2 mm
            assert all(core.path_free(bent[first : first + 21]) for first in range(0, count - 1, 20)) == is_free
            core.margin = MARGIN
    assert 10 < sum(found) < len(found) - 10


def test_what_surely_touches_is_within_the_margin_by_coal_too(arm, core, configurations):
    rng = np.random.default_rng(8)
    core.margin = 0.004
    sure = unsure = 0
    for round_ in range(4):
        scene = [random_shape(rng, kind, kind) for kind in ShapeKind if kind not in TRIANGLES]
        core.set_scene(scene)
        truth = Truth(arm, scene)
        for start, goal in pairwise(configurations(60, 40 + round_)):
            touching = core.touching([start, goal])
            if touching is not None:
                sure += 1
                assert truth.distance(touching) < core.margin + UNSURE
                assert not core.edge_free(start, goal)
            else:
                unsure += not core.edge_free(start, goal)
    assert sure > 10 * unsure


def test_what_is_not_in_doubt_is_free_by_coal_too(arm, core, configurations):
    rng = np.random.default_rng(14)
    scene = [random_shape(rng, kind, kind) for kind in ShapeKind if kind not in TRIANGLES]
    core.set_scene(scene)
    truth, wholly = Truth(arm, scene), 0
    for corners in configurations(90, 50).reshape(30, 3, -1):
        rows = corners[0] + 0.3 * (corners - corners[0])
        intervals = core.unresolved_intervals(rows)
        doubts = np.array([(each.begin, each.end) for each in intervals]).reshape(-1, 2)
        assert not len(doubts) or not core.path_free(rows)
        assert (doubts[:, 0] < doubts[:, 1]).all()
        assert (doubts[:-1, 1] < doubts[1:, 0]).all()
        wholly += len(doubts) == 0
        for place in np.linspace(0.0, 2.0, 80):
            if not ((doubts[:, 0] - 1e-9 <= place) & (place <= doubts[:, 1] + 1e-9)).any():
                first = min(int(place), 1)
                configuration = rows[first] + (place - first) * (rows[first + 1] - rows[first])
                assert truth.distance(configuration) > core.margin - UNSURE
    assert 0 < wholly < 30


def test_what_comes_within_the_margin_is_among_the_pairs_in_doubt(arm, core, configurations):
    rng = np.random.default_rng(15)
    boxes = [random_object(rng, f"box {number}") for number in range(12)]
    world = World(arm, Kinematics(arm), PlanningScene(objects=tuple(boxes)))
    show_scene(core, world)
    core.margin, within, several = 0.004, 0, 0
    for corners in configurations(90, 51).reshape(30, 3, -1):
        rows = corners[0] + 0.3 * (corners - corners[0])
        intervals = core.unresolved_intervals(rows)
        several += sum(len(each.pairs) > 1 for each in intervals)
        for place in np.linspace(0.0, 2.0, 80).tolist():
            first = min(int(place), 1)
            near = world.pairs_within(rows[first] + (place - first) * (rows[first + 1] - rows[first]), core.margin)
            told = {frozenset(pair) for each in intervals if each.begin <= place <= each.end for pair in each.pairs}
            assert {frozenset(pair) for pair in near} <= told
            within += len(near)
    assert within > 20
    assert several > 5


def random_object(rng: np.random.Generator, name: str) -> SceneObject:
    """A box or a cylinder within the arm's reach."""
    size = tuple(rng.uniform(0.02, 0.1, 3).tolist())
    shape = BoxShape(size=size) if rng.random() < 0.5 else CylinderShape(radius=size[0], length=size[1])
    place = tuple((rng.uniform(0.1, 0.4) * directed(rng)).tolist())
    return SceneObject(name=name, shape=shape, pose=Transform(translation=place, rotation=UPRIGHT))


def directed(rng: np.random.Generator) -> np.ndarray:
    """(3,) of length 1."""
    some = rng.normal(size=3)
    return np.asarray(some / np.linalg.norm(some))


@pytest.mark.parametrize("thickness", [0.02, 0.002, 0.0002, 0.00002])
def test_the_thinnest_sheet_is_not_tunnelled_through(thickness):
    core = NativePlanner(load("rm1"))
    sheet = CollisionShape("sheet", ShapeKind.BOX, (0.5, thickness, 0.5), ((0.35, 0.0, 0.25), UPRIGHT))
    core.set_scene([sheet])
    left, right = [1.0, 0.0, 0.1], [-1.0, 0.0, 0.1]
    assert core.free([left, right]).all()
    assert not core.edge_free(left, right)


def test_a_thin_wire_is_not_tunnelled_through_from_any_side():
    core = NativePlanner(load("parol6"))
    rng = np.random.default_rng(3)
    for _ in range(20):
        place = rng.uniform([0.15, -0.3, 0.1], [0.35, 0.3, 0.4]).tolist()
        core.set_scene([CollisionShape("bead", ShapeKind.SPHERE, (1e-4,), ((place[0], place[1], place[2]), UPRIGHT))])
        rows = rng.uniform([-2, -2.4, 1.9, -1.8, -1.5, 0], [2, -0.1, 5.0, 1.8, 1.5, 6], (20, 6))
        rows = rows[core.free(rows)]
        for start, goal in pairwise(rows):
            if core.edge_free(start, goal):
                assert core.free(start + np.linspace(0.0, 1.0, 2000)[:, None] * (goal - start)).all()


def test_a_line_to_itself_is_as_free_as_its_configuration(core, configurations):
    rows = configurations(100, 8)
    assert [core.edge_free(row, row) for row in rows] == core.free(rows).tolist()


def test_a_line_is_as_free_backwards(core, configurations):
    rows = configurations(80, 9)
    for start, goal in pairwise(rows):
        assert core.edge_free(start, goal) == core.edge_free(goal, start)


def test_a_polyline_is_free_where_all_its_lines_are(core, configurations):
    rows = configurations(90, 10)
    rows = rows[core.free(rows)]
    for start in range(0, len(rows) - 3, 3):
        some = rows[start : start + 3]
        both = core.edge_free(some[0], some[1]) and core.edge_free(some[1], some[2])
        assert core.path_free(some) == both


def test_a_curve_is_looked_at_where_it_goes():
    core = NativePlanner(load("rm1"))
    post = CollisionShape("post", ShapeKind.CYLINDER, (0.01, 0.5), ((0.4, 0.0, 0.25), UPRIGHT))
    core.set_scene([post])
    left, right, folded = [1.0, 0.0, 0.1], [-1.0, 0.0, 0.1], [0.0, 2.6, 0.1]
    assert not core.spline_free([left] * 3 + [right] * 3)
    around = [left] * 3 + [[1.0, 2.6, 0.1], folded, folded, [-1.0, 2.6, 0.1]] + [right] * 3
    assert core.spline_free(around)
    truth = Truth(load("rm1"), [post])
    path = FreePath(np.array(around), np.array(around), np.zeros(len(around)), Effort(0.0, 0.0, 0.0, 0, 0))
    rows, _, _ = path.at(np.linspace(0.0, path.spans, 500))
    assert min(truth.distance(row) for row in rows) > core.margin


def test_a_link_that_bulges_much_leaves_no_doubt_about_what_touches_the_others():
    arm = load("rm1")
    core, other = NativePlanner(arm), NativePlanner(arm, bulge=0.03)
    crate = CollisionShape("crate", ShapeKind.BOX, (0.2, 0.2, 0.4), ((0.35, 0.0, 0.2), UPRIGHT))
    rng = np.random.default_rng(2)
    sure = 0
    for planner in (core, other):
        planner.set_scene([crate])
    truth = Truth(arm, [crate])
    limits = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    for start, goal in pairwise(rng.uniform(*limits, (60, len(arm.joints)))):
        touching = other.touching([start, goal])
        if touching is not None:
            sure += 1
            assert truth.distance(touching) < core.margin + UNSURE
            assert not core.edge_free(start, goal)
    assert sure > 5
