"""The native planner's path continued to where only the exact shapes let the arm be: its curve stays as it is."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gemelo.services.planner.collision_geometry.shapes import ShapeKind
from gemelo.services.planner.native.paths import FreePath
from gemelo.services.planner.path.curve import spline_rows
from gemelo.services.planner.path.smoothing import Rounded, smooth, smooth_unknown
from gemelo.services.planner.request.deadline import NEVER
from tests.planner.native.scenes import random_shape
from tests.profiles import examples

SIMPLE = [kind for kind in ShapeKind if kind not in (ShapeKind.MESH, ShapeKind.HULL)]
ROWS = 24  # of a span of a curve


class Room:
    """Everything is free but a ball; curves and lines are looked at densely."""

    def __init__(self, middle: np.ndarray, radius: float) -> None:
        self._middle, self._radius = middle, radius

    def is_line_free(self, start: np.ndarray, goal: np.ndarray) -> bool:
        return self._is_free(start + np.linspace(0.0, 1.0, 400)[:, None] * (goal - start))

    def is_curve_free(self, control: np.ndarray) -> bool:
        return self._is_free(spline_rows(control, ROWS))

    def _is_free(self, rows: np.ndarray) -> bool:
        return bool((np.linalg.norm(rows - self._middle, axis=1) > self._radius).all())


def test_the_shares_of_a_path_are_those_of_its_curve(core, configurations):
    """Both languages lay the same control points for them."""
    rng = np.random.default_rng(4)
    cut = sharp = 0
    for round_ in range(10):
        core.set_scene([random_shape(rng, kind, kind) for kind in SIMPLE])
        rows = configurations(80, 60 + round_)
        rows = rows[core.free(rows)]
        for start, goal in zip(rows[::2], rows[1::2], strict=False):
            path = core.plan(start, goal, seed=round_, time_limit=0.1)
            if not isinstance(path, FreePath):
                continue
            room = Room(np.full(len(start), 1e3), 1.0)
            assert np.array_equal(smooth_unknown(Rounded(path.corners, path.shares), room, NEVER), path.control)
            cut += int((path.shares > 0.0).sum())
            sharp += int((path.shares[1:-1] < 0.5).sum())
    assert cut > 20
    assert sharp > 0


@examples(quick=15, full=60)
@given(seed=st.integers(0, 10_000), count=st.integers(2, 6), is_at_end=st.booleans())
def test_what_is_continued_is_free_begins_and_ends_where_it_should_and_else_stays(
    seed: int, count: int, is_at_end: bool
):
    rng = np.random.default_rng(seed)
    corners, end, middle = rng.uniform(-1.0, 1.0, (count, 3)), rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3)
    room = Room(middle, 0.35)
    assume(all(room.is_line_free(one, other) for one, other in pairwise(corners)))
    assume(room.is_line_free(end, corners[-1 if is_at_end else 0]))
    before = smooth(corners, room, NEVER)
    path = Rounded(corners, shares_of(before, corners))
    path = path.turned.continued(end, room).turned if is_at_end else path.continued(end, room)
    control = smooth_unknown(path, room, NEVER)
    assert room.is_curve_free(control)
    assert control[0] == pytest.approx(corners[0] if is_at_end else end)
    assert control[-1] == pytest.approx(end if is_at_end else corners[-1])
    if count > 4:  # the corners beside the join may be cut less
        kept = before[: _place(before, corners[1])] if is_at_end else before[_place(before, corners[-2]) + 2 :]
        assert all((control == row).all(axis=1).any() for row in kept)


def _place(control: np.ndarray, corner: np.ndarray) -> int:
    return int(np.flatnonzero((control == corner).all(axis=1))[0])


def shares_of(control: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """How far each corner is cut, read from its curve."""
    shares = np.zeros(len(corners))
    for number in range(1, len(corners) - 1):
        after = control[_place(control, corners[number]) + 1]
        edge = corners[number + 1] - corners[number]
        shares[number] = float((after - corners[number]) @ edge / (edge @ edge))
    return shares
