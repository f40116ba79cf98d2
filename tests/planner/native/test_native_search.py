"""The tree of the search against a look at every node, and how many checks narrow passages take."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.collision.sphere_check import native_scene
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.native_planner import NativePlanner
from gemelo.services.planner.native.paths import FreePath
from gemelo.tools.bench.any_arm.drawn_problems import problems
from gemelo.tools.bench.any_arm.generated_arms import generated_arm
from gemelo.tools.bench.any_arm.narrow_families import NARROW

MOST_JOINTS = 16
POINTS = 20
DRAWN = 8  # problems of each family
CLOSED = {("six", "barred cage", 3), ("six", "barred cage", 5)}  # no planner of the bench finds a way
MOST_CHECKS = 50_000  # for the worst of them; with long steps and without a domain it takes 110,000 to 440,000


@given(
    seed=st.integers(0, 2**32 - 1),
    dof=st.integers(1, MOST_JOINTS),
    count=st.integers(1, 70),
    steps=st.sampled_from((4, 1_000_000)),
)
def test_the_nearest_node_is_the_first_that_a_look_at_every_node_finds(seed: int, dof: int, count: int, steps: int):
    """With few steps many nodes are equally near."""
    random = np.random.default_rng(seed)
    rows, points = (random.integers(-steps, steps, (n, dof)) / steps * 3.0 for n in (count, POINTS))
    weights = random.uniform(0.2, 3.0, dof)
    found = motion.nearest_rows(rows, weights, points)
    assert found.tolist() == [_nearest(rows, weights, point) for point in points]


def _nearest(rows: np.ndarray, weights: np.ndarray, point: np.ndarray) -> int:
    """By floats, added up joint by joint: to the bit as the core does."""
    ways = (weights * rows).astype(np.float32) - (weights * point).astype(np.float32)
    sums = np.zeros(len(rows), dtype=np.float32)
    for column in ways.T:
        sums += column * column
    return int(np.argmin(sums))


def test_the_nearest_of_many_nodes_is_the_nearest_by_doubles_but_for_rounding():
    random = np.random.default_rng(1)
    rows, points = random.uniform(-3.0, 3.0, (5003, 7)), random.uniform(-3.0, 3.0, (200, 7))
    weights = random.uniform(0.2, 3.0, 7)
    found = motion.nearest_rows(rows, weights, points)
    distances = np.linalg.norm((rows[None] - points[:, None]) * weights, axis=2)
    assert np.allclose(distances[np.arange(len(points)), found], distances.min(axis=1), rtol=1e-6)
    assert len(set(found.tolist())) > 150


@pytest.mark.parametrize("name", ["six", "seven", "eight"])
def test_narrow_passages_are_found_in_few_checks(name: str):
    """Counted, not timed: the same on every machine."""
    arm = generated_arm(name)
    kinematics, core = Kinematics(arm), NativePlanner(arm)
    for family in NARROW:
        drawn = problems(arm, kinematics, family, DRAWN, NARROW)
        for problem in (each for each in drawn if (name, family, each.seed) not in CLOSED):
            core.set_scene(native_scene(arm, problem.setting.scene)[0])
            path = core.plan(problem.start, problem.goal, seed=1, time_limit=20.0, enough=500)
            assert isinstance(path, FreePath), (family, problem.seed)
            assert path.effort.checks < MOST_CHECKS, (family, problem.seed)
