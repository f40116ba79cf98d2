"""Ways from a start to a goal: found, short, smooth, the same for the same seed, and ended when asked."""

from __future__ import annotations

import threading
import time
from itertools import pairwise, product

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind
from gemelo.services.planner.native.binding import CancelFlag
from gemelo.services.planner.native.native_planner import NativePlanner
from gemelo.services.planner.native.paths import FailureReason, FreePath, NoPath
from gemelo.tools.bench.scenes import SCENES
from tests.planner.native.coal_truth import Truth
from tests.planner.native.conftest import load

UNSURE = 1e-5  # [m] of coal's own distances
LONGER = 1.06  # times as long as the shortest of eight: a path of one search
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def crate(name: str, size: tuple[float, float, float], place: tuple[float, float, float]) -> CollisionShape:
    return CollisionShape(name, ShapeKind.BOX, size, (place, UPRIGHT))


SHELF = [
    crate("back", (0.02, 0.5, 0.5), (0.45, 0.0, 0.3)),
    crate("lower", (0.2, 0.5, 0.02), (0.36, 0.0, 0.1)),
    crate("upper", (0.2, 0.5, 0.02), (0.36, 0.0, 0.3)),
    crate("left", (0.2, 0.02, 0.5), (0.36, 0.25, 0.3)),
    crate("right", (0.2, 0.02, 0.5), (0.36, -0.25, 0.3)),
]
POSTS = [
    CollisionShape(f"post {i}", ShapeKind.CYLINDER, (0.01, 0.6), ((0.38 * np.cos(a), 0.38 * np.sin(a), 0.3), UPRIGHT))
    for i, a in enumerate(np.linspace(0.3, 2.0 * np.pi + 0.3, 8, endpoint=False))
]


@pytest.mark.parametrize("scene", [[], SHELF, POSTS], ids=["empty", "shelf", "posts"])
def test_a_path_is_free_all_along_exact_at_its_ends_and_within_the_limits(scene, arm, core, configurations):
    core.set_scene(scene)
    rows, truth = configurations(200, 1), Truth(arm, scene)
    rows = rows[core.free(rows)]
    found = 0
    for seed, (start, goal) in enumerate(zip(rows[0:16:2], rows[1:17:2], strict=True)):
        path = core.plan(start, goal, seed=seed, time_limit=5.0)
        if isinstance(path, NoPath):
            assert path.reason is FailureReason.TIMED_OUT
            continue
        found += 1
        curve, slope, _ = path.at(np.linspace(0.0, path.spans, 400))
        assert np.array_equal(path.corners[[0, -1]], [start, goal])
        assert np.allclose(curve[[0, -1]], [start, goal], rtol=0.0, atol=1e-12)
        assert np.allclose(slope[[0, -1]], 0.0, atol=1e-12)
        assert min(truth.distance(row) for row in curve) > core.margin - UNSURE
        for column, joint in zip(curve.T, arm.joints, strict=True):
            assert joint.lower - 1e-12 <= column.min()
            assert column.max() <= joint.upper + 1e-12
    assert found >= 6


def test_the_curve_is_twice_continuously_differentiable(arm, core, configurations):
    core.set_scene(SHELF)
    start, goal = _bent(core, configurations(400, 3))
    path = core.plan(start, goal, seed=7, time_limit=10.0)
    assert isinstance(path, FreePath)
    knots = np.arange(1.0, path.spans)
    for before, after in zip(path.at(knots - 1e-7), path.at(knots + 1e-7), strict=True):
        assert np.abs(before - after).max() < 1e-5
    steps = np.linspace(0.01, path.spans - 0.01, 300)
    position, slope, bend = path.at(steps)
    h = 1e-5
    assert np.allclose(slope, (path.at(steps + h)[0] - path.at(steps - h)[0]) / (2 * h), atol=1e-6)
    assert np.allclose(bend, (path.at(steps + h)[1] - path.at(steps - h)[1]) / (2 * h), atol=1e-4)
    assert position.shape == (300, len(arm.joints))


def test_the_same_seed_gives_the_same_path_and_another_seed_another(core, configurations):
    core.set_scene(SHELF)
    start, goal = _bent(core, configurations(400, 3))
    once, again, other = (core.plan(start, goal, seed=seed) for seed in (7, 7, 8))
    assert all(isinstance(path, FreePath) for path in (once, again, other))
    assert np.array_equal(once.corners, again.corners)
    assert np.array_equal(once.control, again.control)
    assert once.effort.checks == again.effort.checks
    assert not np.array_equal(once.control, other.control)


def test_more_searches_make_no_path_longer_and_all_are_free(arm, core, configurations):
    core.set_scene(SHELF)
    rows = configurations(400, 5)
    rows = rows[core.free(rows)]
    speeds = np.array([joint.velocity for joint in arm.joints])
    once, more = [], []
    for seed, (start, goal) in enumerate(zip(rows[0:40:2], rows[1:41:2], strict=True)):
        single, several = (core.plan(start, goal, seed=seed, time_limit=20.0, enough=enough) for enough in (0, 200_000))
        if isinstance(single, NoPath):
            continue
        assert isinstance(several, FreePath)
        assert core.path_free(several.corners)
        assert core.spline_free(several.control)
        assert np.array_equal(several.corners[[0, -1]], [start, goal])
        for found, path in ((once, single), (more, several)):
            found.append(float(np.linalg.norm(np.diff(path.corners, axis=0) / speeds, axis=1).sum()))
    assert len(once) >= 10
    assert (np.array(more) <= np.array(once) + 1e-9).all()
    assert sum(more) < sum(once)


def test_no_other_search_is_begun_where_nothing_is_to_be_gained(core, configurations):
    core.set_scene([])
    rows = configurations(400, 5)
    start, goal = next((a, b) for a, b in pairwise(rows) if core.edge_free(a, b))
    single, several = (core.plan(start, goal, enough=enough) for enough in (0, 10**9))
    assert len(single.corners) == 2
    assert several.effort.checks == single.effort.checks


def test_the_first_path_is_looked_for_where_short_ones_are(core, configurations):
    """Without any search for a shorter one it is seldom much longer than the shortest of many."""
    core.set_scene(SHELF)
    rows = configurations(400, 5)
    rows = rows[core.free(rows)]
    speeds = np.array([joint.velocity for joint in core.arm.joints])
    ratios = []
    for start, goal in zip(rows[0:60:2], rows[1:61:2], strict=True):
        paths = [core.plan(start, goal, seed=seed, time_limit=20.0) for seed in range(8)]
        found = [float(np.linalg.norm(np.diff(path.corners, axis=0) / speeds, axis=1).sum()) for path in paths]
        ratios += [length / min(found) for length in found]
    assert np.mean(ratios) < LONGER


def test_what_the_spheres_say_of_a_configuration_for_certain_is_so_on_the_exact_shapes(arm, configurations):
    world = World(arm, Kinematics(arm), SCENES["shelf"])
    checker = CollisionChecker(world)
    spheres = checker.native(CLEARANCE)
    touching = 0
    for row in configurations(150, 6):
        distance = world.distance(row)
        assert checker.least_distance(row) <= max(distance, 0.0) + UNSURE
        if spheres.is_free(row):
            assert distance >= CLEARANCE
        elif spheres.touching(np.array((row, row))) is not None:
            touching += 1
            assert distance < CLEARANCE
    assert touching > 10


def _bent(core: NativePlanner, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first two neighbouring free rows that no straight line joins, but a path does."""
    for start, goal in pairwise(rows[core.free(rows)]):
        path = core.plan(start, goal, seed=7, time_limit=0.5)
        if isinstance(path, FreePath) and len(path.corners) > 2:
            return start, goal
    raise AssertionError("there is no such pair")


def test_every_build_of_the_check_finds_the_same_path(arm, configurations):
    paths = []
    for kernel in ("plain", "vector", ""):
        core = NativePlanner(arm, kernel=kernel)
        core.set_scene(SHELF)
        rows = configurations(60, 4)
        rows = rows[core.free(rows)]
        paths.append(
            [core.plan(a, b, seed=2, time_limit=20.0) for a, b in zip(rows[0:12:2], rows[1:13:2], strict=True)]
        )
    for plain, vector, best in zip(*paths, strict=True):
        assert isinstance(plain, FreePath)
        assert np.array_equal(plain.control, vector.control)
        assert np.array_equal(plain.control, best.control)


def test_lines_that_are_known_to_be_blocked_are_not_looked_at_again(core, configurations):
    core.set_scene(SHELF)
    start, goal = _bent(core, configurations(400, 3))
    looked, known = (core.plan(start, goal, seed=7, are_lines_blocked=blocked) for blocked in (False, True))
    assert isinstance(looked, FreePath)
    assert isinstance(known, FreePath)
    assert np.array_equal(looked.control, known.control)
    assert known.effort.checks < looked.effort.checks


def test_any_of_several_goals_will_do():
    core = NativePlanner(load("rm1"))
    core.set_scene([crate("crate", (0.1, 0.1, 0.3), (0.4, 0.0, 0.15))])
    inside, outside = [0.0, 0.0, 0.1], [1.0, 0.5, 0.1]
    path = core.plan([-1.0, 0.0, 0.1], [inside, outside], seed=1, time_limit=5.0)
    assert isinstance(path, FreePath)
    assert path.corners[-1].tolist() == outside


def test_more_goals_than_one_question_holds_are_all_asked_about():
    core = NativePlanner(load("rm1"))
    core.set_scene([crate("crate", (0.1, 0.1, 0.3), (0.4, 0.0, 0.15))])
    inside, outside = [0.0, 0.0, 0.1], [1.0, 0.5, 0.1]
    path = core.plan([-1.0, 0.0, 0.1], [*[inside] * 20, outside], seed=1, time_limit=5.0)
    assert isinstance(path, FreePath)
    assert path.corners[-1].tolist() == outside
    assert core.path_free(path.corners)


def test_a_start_and_a_goal_that_touch_are_told_apart():
    core = NativePlanner(load("rm1"))
    core.set_scene([crate("crate", (0.1, 0.1, 0.3), (0.4, 0.0, 0.15))])
    inside, outside = [0.0, 0.0, 0.1], [1.0, 0.5, 0.1]
    assert core.plan(inside, outside).reason is FailureReason.START_TOUCHES
    assert core.plan(outside, inside).reason is FailureReason.GOAL_TOUCHES


def walled() -> tuple[NativePlanner, list[float], list[float]]:
    """A goal behind a wall that rm1 cannot get around: the search never ends by itself."""
    core = NativePlanner(load("rm1"))
    sheet = (1.0, 0.02, 1.0)
    core.set_scene([crate("wall", sheet, (0.6, 0.0, 0.5)), crate("rear", sheet, (-0.6, 0.0, 0.5))])
    return core, [1.2, 0.0, 0.1], [-1.2, 0.0, 0.1]


def test_the_time_limit_ends_a_search():
    core, start, goal = walled()
    began = time.monotonic()
    ended = core.plan(start, goal, time_limit=0.05)
    assert isinstance(ended, NoPath)
    assert ended.reason is FailureReason.TIMED_OUT
    assert time.monotonic() - began < 2.0


def test_a_search_whose_time_is_counted_ends_at_the_same_check_however_busy_the_machine_is():
    core, start, goal = walled()
    ended = [core.plan(start, goal, time_limit=0.1, cancel=CancelFlag(2e-5)) for _ in range(2)]
    assert all(isinstance(each, NoPath) and each.reason is FailureReason.TIMED_OUT for each in ended)
    assert ended[0].effort.search == pytest.approx(0.1, abs=1e-4)
    assert ended[0].effort == ended[1].effort


def test_a_counted_time_is_that_of_all_who_ask():
    core, start, goal = walled()
    counted = CancelFlag(2e-5)
    assert counted.time(5) == pytest.approx(1e-4)
    core.plan(start, goal, time_limit=0.1, cancel=counted)
    assert 0.1 < counted.time() < 0.11
    counted.set()
    assert core.plan(start, goal, time_limit=0.1, cancel=counted).reason is FailureReason.CANCELLED


def test_another_thread_can_end_a_search_and_do_other_things_meanwhile():
    core, start, goal = walled()
    cancel, ended = CancelFlag(), []
    searching = threading.Thread(target=lambda: ended.append(core.plan(start, goal, time_limit=60.0, cancel=cancel)))
    searching.start()
    for _ in range(20):
        assert core.free([start, goal]).all()
        time.sleep(0.005)
    core.set_scene([])  # the search goes on in the scene that it began in
    assert searching.is_alive()
    cancel.set()
    searching.join(timeout=60.0)
    assert not searching.is_alive()
    assert ended[0].reason is FailureReason.CANCELLED
    assert core.edge_free(start, goal)


def test_a_search_that_finds_nothing_had_nothing_to_find():
    """Against a flood over a grid of configurations, which may squeeze through where the search may not."""
    core = NativePlanner(load("rm1"))
    rng = np.random.default_rng(5)
    counts = (41, 41, 5)
    axes = [np.linspace(joint.lower, joint.upper, n) for joint, n in zip(core.arm.joints, counts, strict=True)]
    grid = np.array(list(product(*axes)))
    solved = 0
    for _ in range(4):
        boxes = [crate(f"{i}", tuple(rng.uniform(0.05, 0.15, 3)), (*rng.uniform(-0.4, 0.4, 2), 0.1)) for i in range(4)]
        core.set_scene(boxes)
        free = core.free(grid).reshape(counts)
        places = np.argwhere(free)
        floods: list[set[tuple[int, ...]]] = []  # a line is free both ways: what one has reached needs no other
        for first, second in rng.choice(len(places), (8, 2)):
            start, goal = tuple(places[first]), tuple(places[second])
            reached = next((flood for flood in floods if start in flood), None)
            if reached is None:
                reached = _flood(core, grid.reshape(*counts, 3), free, start)
                floods.append(reached)
            if goal not in reached:
                continue
            path = core.plan(grid.reshape(*counts, 3)[start], grid.reshape(*counts, 3)[goal], seed=1, time_limit=10.0)
            assert isinstance(path, FreePath)
            solved += 1
    assert solved > 5


def _flood(core: NativePlanner, grid: np.ndarray, free: np.ndarray, start: tuple[int, ...]) -> set[tuple[int, ...]]:
    """The cells that can be reached from one to the next along free lines."""
    reached, waiting = {start}, [start]
    while waiting:
        here = waiting.pop()
        for axis, step in product(range(3), (-1, 1)):
            there = tuple(value + step * (axis == i) for i, value in enumerate(here))
            if min(there) < 0 or any(a >= b for a, b in zip(there, free.shape, strict=True)):
                continue
            if there not in reached and free[there] and core.edge_free(grid[here], grid[there]):
                reached.add(there)
                waiting.append(there)
    return reached


def test_a_plan_of_nonsense_is_refused():
    core = NativePlanner(load("rm1"))
    with pytest.raises(ValueError, match="is not within 100 rad or m of 0"):
        core.plan([0.0, 0.0, 0.1], [0.0, float("nan"), 0.1])
    with pytest.raises(ValueError, match=r"\(3,\)"):
        core.plan([0.0, 0.0], [0.0, 0.0, 0.1])
    with pytest.raises(ValueError, match="at least one goal"):
        core.plan([0.0, 0.0, 0.1], np.zeros((0, 3)))


def test_an_arm_that_stands_close_to_something_gets_away_from_it():
    core = NativePlanner(load("rm1"))
    start, goal = [0.3, 0.2, 0.05], [-1.5, 0.4, 0.15]
    tables = (
        CollisionShape("table", ShapeKind.HALF_SPACE, (), ((0.0, 0.0, z), UPRIGHT))
        for z in np.arange(0.0, 0.06, 0.0002)
    )
    for table in tables:
        core.set_scene([table])
        if core.distance(start) < core.margin + 0.0006:
            break
    assert core.margin + 0.0003 < core.distance(start)
    assert isinstance(core.plan(start, goal, time_limit=5.0), FreePath)
