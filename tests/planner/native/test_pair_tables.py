"""Tables of distances between links: never more than coal's, and read as they are written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.services.planner.collision import pair_tables
from gemelo.services.planner.collision.sphere_check import native_planner
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.native import model_cache
from gemelo.services.planner.native.distance_tables import Axis, PairTable
from gemelo.services.planner.native.native_planner import NativePlanner
from gemelo.tools.bench.any_arm.generated_arms import HALF, ArmSketch, MovingLink, SketchSolid, written

CELLS = 16
UNSURE = 1e-5  # [m] of coal's own distances
SKIN = 2e-5  # [m] that a table keeps of those


def arm_of(
    folder: Path, base: SketchSolid, hand: tuple[SketchSolid, ...], limits: tuple[float, float]
) -> ArmDescription:
    """Two joints between a base and a hand, and no link with a shape between."""
    links = (
        MovingLink((0.0, 0.0, 0.0), 0.0, (-math.pi, math.pi), 2.0, ()),
        MovingLink((0.04, 0.0, 0.1), HALF, limits, 2.0, hand),
    )
    sketch = ArmSketch("near", (base,), links, (0.0, 0.0, 0.1), (), (0.0, 0.0))
    return load_arm(written(sketch, folder))


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> ArmDescription:
    """Its hand is 4 to 50 mm from the base."""
    hand = (SketchSolid((0.03, 0.05, 0.04), (0.0, -0.045, 0.01)), SketchSolid((0.02, 0.06), (0.02, -0.03, 0.0), "x"))
    base = SketchSolid((0.22, 0.2, 0.06), (0.0, 0.0, -0.006))
    return arm_of(tmp_path_factory.mktemp("near") / "near", base, hand, (-0.9, 0.8))


@pytest.fixture(scope="module")
def inside(tmp_path_factory: pytest.TempPathFactory) -> NativePlanner:
    """Its hand is always within the base: only a table can call it free."""
    hand, base = (SketchSolid((0.05,), (0.0, 0.0, 0.0)),), SketchSolid((1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    return NativePlanner(arm_of(tmp_path_factory.mktemp("inside") / "near", base, hand, (-1.0, 1.0)))


def test_a_bound_is_never_more_than_coals_distance_and_not_much_less(near: ArmDescription):
    planner, world = native_planner(near), World(near, Kinematics(near))
    assert planner is not None
    [table] = pair_tables.pair_tables(near, planner)
    assert {table.first, table.second} == {"link_0", "link_2"}
    assert [axis.is_turn for axis in table.axes] == [True, False]
    lower, upper = [axis.low for axis in table.axes], [axis.high for axis in table.axes]
    rows = np.random.default_rng(3).uniform(lower, upper, (1500, 2))
    rows[:200] = np.round((rows[:200] - lower) / np.subtract(upper, lower) * pair_tables.CELLS) / pair_tables.CELLS
    rows[:200] = rows[:200] * np.subtract(upper, lower) + lower  # on the corners of cells
    places = np.minimum((rows - lower) / np.subtract(upper, lower) * pair_tables.CELLS, pair_tables.CELLS - 1)
    bounds = table.bounds[tuple(places.astype(int).T)]
    distances = np.array([world.distance(row) for row in rows])
    assert (bounds <= distances + UNSURE).all()
    assert distances.min() < 0.006
    is_far = distances > 0.008
    assert is_far.sum() > 200
    assert (bounds[is_far] > 0.25 * distances[is_far]).all()


def test_with_a_table_more_is_free_and_all_that_is_free_is_so_by_coal(near: ArmDescription):
    planner, plain = native_planner(near), NativePlanner(near)
    assert planner is not None
    world = World(near, Kinematics(near))
    random = np.random.default_rng(4)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in near.joints]).T
    rows = random.uniform(lower, upper, (600, 2))
    planner.margin = plain.margin = 0.001
    free, before = planner.free(rows), plain.free(rows)
    distances = np.array([world.distance(row) for row in rows])
    assert (free >= before).all()
    assert free.sum() > before.sum() + 10
    assert (distances[free] > 0.001 - UNSURE).all()
    ends = rows.reshape(-1, 2, 2)
    found = [(one, other) for one, other in ends if planner.edge_free(one, other)]
    assert len(found) > sum(plain.edge_free(one, other) for one, other in ends)
    for one, other in found:
        line = one + np.linspace(0.0, 1.0, 60)[:, None] * (other - one)
        assert min(world.distance(row) for row in line) > 0.001 - UNSURE
    assert planner.distance(rows[int(distances.argmax())]) <= distances.max() + UNSURE


def test_a_table_is_made_once_for_an_arm(near: ArmDescription, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv(model_cache.FOLDER, str(tmp_path))
    planner = native_planner(near)
    assert planner is not None
    once = pair_tables.pair_tables(near, planner)
    monkeypatch.setattr(pair_tables, "bounds_of", lambda *_: pytest.fail("made again"))
    again = pair_tables.pair_tables(near, planner)
    assert [np.array_equal(one.bounds, other.bounds) for one, other in zip(once, again, strict=True)] == [True]


@pytest.mark.parametrize("seed", range(4))
def test_cells_are_read_as_they_are_written(inside: NativePlanner, seed: int):
    """Of configurations by their cell, of lines by all cells that they lead through, around a whole turn too."""
    random = np.random.default_rng(seed)
    bounds = np.where(random.uniform(size=(CELLS, CELLS)) < 0.12, -1.0, 1.0)
    axes = Axis(0, -math.pi, math.pi, is_turn=True), Axis(1, -1.0, 1.0, is_turn=False)
    inside.set_tables([PairTable("link_0", "link_2", axes, bounds)])
    rows = random.uniform((-9.0, -1.0), (9.0, 1.0), (500, 2))
    rows = rows[_far_from_borders(rows)]
    assert inside.free(rows).tolist() == (_cells(bounds, rows) > 0.0).tolist()
    outside = np.column_stack((rows[:, 0], np.sign(rows[:, 1]) * 1.2))
    assert not inside.free(outside).any()
    verdicts = []
    for one, other in zip(rows[::2], rows[1::2], strict=False):
        near = one + 0.25 * (other - one)
        line = one + np.linspace(0.0, 1.0, 1000)[:, None] * (near - one)
        verdicts.append(inside.edge_free(one, near))
        assert _cells(bounds, line).min() > 0.0 or not verdicts[-1]
        assert verdicts[-1] or not min(_cells(bounds, line + shift).min() for shift in _AROUND) > 0.0
    assert 5 < sum(verdicts) < len(verdicts) - 5


def test_without_a_table_the_hand_is_in_the_base(inside: NativePlanner):
    inside.set_tables([])
    assert not inside.free(np.random.default_rng(0).uniform(-1.0, 1.0, (50, 2))).any()


_AROUND = [np.array((x, y)) for x in (-0.01, 0.0, 0.01) for y in (-0.01, 0.0, 0.01)]


def _scaled(rows: np.ndarray) -> np.ndarray:
    """(m, 2) places in cells, the first joint's within one turn."""
    return (
        np.stack(((rows[..., 0] + math.pi) / math.tau % 1.0, np.clip((rows[..., 1] + 1.0) / 2.0, 0.0, 1.0)), -1) * CELLS
    )


def _far_from_borders(rows: np.ndarray) -> np.ndarray:
    return (np.abs(_scaled(rows) - np.round(_scaled(rows))) > 0.02).all(axis=1)


def _cells(bounds: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(m,) the bounds of the cells that the configurations (m, 2) are in."""
    places = np.minimum(_scaled(rows).astype(int), CELLS - 1)
    return np.asarray(bounds[places[:, 0], places[:, 1]])
