"""The references of the planner's paths: the best known ones, and the grid that decides if any path exists."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.tools.bench.problems import known_paths
from gemelo.tools.bench.problems.known_paths import JointGrid, islands, tightened
from gemelo.tools.bench.problems.problem_sets import path_length
from gemelo.tools.bench.scenes import rm1

ONES = np.ones(2)


class Disc:
    """A point that keeps out of a disc in the middle of the plane."""

    radius = 0.5

    def touching(self, positions: np.ndarray, margin: float) -> np.ndarray | None:
        rows = np.concatenate([a + np.linspace(0.0, 1.0, 50)[:, None] * (b - a) for a, b in pairwise(positions)])
        inside = np.linalg.norm(rows, axis=1) < self.radius + margin
        return rows[inside][0] if inside.any() else None


class Wall:
    """Joint values between which the first joint cannot stand, but where the second is in the gap."""

    def __init__(self, gap: float) -> None:
        self.gap = gap

    def touching(self, positions: np.ndarray, margin: float) -> np.ndarray | None:
        rows = np.linspace(positions[0], positions[-1], 20)
        inside = (np.abs(rows[:, 0]) < 0.3) & (rows[:, 1] > self.gap)
        return rows[inside][0] if inside.any() else None


def test_a_detour_is_pulled_tight_around_what_is_in_its_way():
    rows = np.array([[-1.0, 0.0], [-1.0, 2.0], [1.0, 2.0], [1.0, 0.0]])
    tight = tightened(rows, ONES, 1, ValidityChecker(Disc(), 0.0), pushes=2000)
    tangent = 2.0 * (np.sqrt(0.75) + 0.5 * np.pi / 6.0)
    assert tangent <= path_length(tight, ONES) < 1.1 * tangent
    assert tight[[0, -1]].tolist() == rows[[0, -1]].tolist()
    assert Disc().touching(tight, 0.0) is None


def test_a_straight_path_is_as_tight_as_it_can_be():
    rows = np.array([[-1.0, 1.0], [1.0, 1.0]])
    assert tightened(rows, ONES, 1, ValidityChecker(Disc(), 0.0), pushes=10) is rows


def test_islands_are_what_is_joined():
    free = np.array([[1, 1, 0, 1], [0, 1, 0, 1], [1, 0, 0, 1]], dtype=bool)
    joined = [free[:-1] & free[1:], free[:, :-1] & free[:, 1:]]
    numbers = islands(free, joined)
    assert (numbers == known_paths.NOWHERE).tolist() == (~free).tolist()
    assert numbers[0, 0] == numbers[0, 1] == numbers[1, 1]
    assert numbers[0, 3] == numbers[1, 3] == numbers[2, 3]
    assert len({numbers[0, 0], numbers[0, 3], numbers[2, 0]}) == 3


@pytest.mark.parametrize(("gap", "is_open"), [(-2.0, True), (-9.0, False)])
def test_a_grid_decides_if_any_path_exists(monkeypatch: pytest.MonkeyPatch, gap: float, is_open: bool):
    monkeypatch.setattr(known_paths, "STEP", 0.25)
    arm = dataclasses.replace(rm1(), joints=rm1().joints[:2])
    grid = JointGrid(arm, ONES, ValidityChecker(Wall(gap), 0.0))
    assert grid.is_connected(np.array([-1.0, 1.0]), np.array([1.0, 1.0])) is is_open
    assert grid.is_connected(np.array([1.0, 1.0]), np.array([2.0, -1.0]))
