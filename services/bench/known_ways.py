"""The shortest way that much time finds, to hold the planner's own against: many searches, then tightened.

Lengths are what the searches shorten: times at full speed, measured as in space (joint values divided by their speed
limits). All ways keep the planner's own clearance on the exact shapes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm
from services.bench.problem_sets import way_length
from services.planner.collision.checker import CollisionChecker
from services.planner.collision.clearance import CLEARANCE
from services.planner.path.ompl_search import ompl_corners
from services.planner.path.path import PathNotFound
from services.planner.path.smoothing import shorten
from services.planner.path.validity import ValidityChecker
from services.planner.request.deadline import Deadline

if TYPE_CHECKING:
    from services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

SEEDS = 100  # searches by the compiled core
LONG_RUNS = (("BITstar", 1), ("BITstar", 2), ("RRTstar", 1))  # with their seeds; each is shortened
NARROW_RUNS = (("RRTConnect", 1), ("RRTConnect", 2), ("RRTConnect", 3))  # where the core's spheres are too large
PATIENCE = 5.0  # [s] for one search
TIGHTENED = 4  # of the shortest ones
PUSHES, LAST_PUSHES = 4000, 400  # of random corners, kept where they shorten: between spheres, and on the exact shapes
WIDEST, NARROWEST = 0.2, 0.002  # [s at full speed] of a push, at first and at last


class Spheres:
    """The compiled core alone: a way touches where it does not let all of it be."""

    def __init__(self, core: NativePlanner) -> None:
        self._core = core

    def touching(self, positions: Array, margin: float) -> Array | None:
        return None if self._core.path_free(positions) else np.asarray(positions[0])


def shortest(arm: Arm, checker: CollisionChecker, start: Array, goals: Array) -> tuple[Array, str] | None:
    """A polyline (m, n) from `start` to one of `goals` (k, n), and what found it; None where nothing did."""
    core = checker.native(CLEARANCE)
    if core is None:
        raise RuntimeError("the compiled motion core is needed to look for the shortest ways: run `make setup`")
    speeds = np.array([joint.velocity for joint in arm.joints])
    cautious, exact = ValidityChecker(Spheres(core), CLEARANCE), ValidityChecker(checker, CLEARANCE)
    found = _by_core(core, start, goals)
    found += _by_ompl(arm, cautious, LONG_RUNS, start, goals) if found else []
    found = found or _by_ompl(arm, exact, NARROW_RUNS, start, goals)
    found.sort(key=lambda way: way_length(way[0], speeds))
    tight = [
        (tightened(rows, speeds, seed, cautious, PUSHES), name) for seed, (rows, name) in enumerate(found[:TIGHTENED])
    ]
    if not tight:
        return None
    rows, name = min(tight, key=lambda way: way_length(way[0], speeds))
    return tightened(rows, speeds, TIGHTENED, exact, LAST_PUSHES), name


def tightened(rows: Array, speeds: Array, seed: int, validity: ValidityChecker, pushes: int) -> Array:
    """The polyline pulled tight: with one more corner on every edge, all of them pushed about."""
    if len(rows) == 2:
        return rows
    random = np.random.default_rng(seed)
    rows = _finer(rows)
    for width in np.geomspace(WIDEST, NARROWEST, pushes).tolist():
        corner = int(random.integers(1, len(rows) - 1))
        before, here, after = rows[corner - 1 : corner + 2]
        inwards = random.uniform() * (0.5 * (before + after) - here)
        pushed = here + inwards + random.normal(0.0, width, len(speeds)) * speeds
        now, then = np.array([before, here, after]), np.array([before, pushed, after])
        is_shorter = way_length(then, speeds) < way_length(now, speeds)
        if is_shorter and validity.is_line_free(before, pushed) and validity.is_line_free(pushed, after):
            rows[corner] = pushed
    return rows


def _by_core(core: NativePlanner, start: Array, goals: Array) -> list[tuple[Array, str]]:
    from services.planner.native.paths import NoPath

    paths = []
    for seed in range(SEEDS):
        path = core.plan(start, goals, seed=seed, time_limit=PATIENCE)
        if isinstance(path, NoPath):
            break
        paths.append((path.corners, "native"))
    return paths


def _by_ompl(
    arm: Arm, validity: ValidityChecker, runs: Sequence[tuple[str, int]], start: Array, goals: Array
) -> list[tuple[Array, str]]:
    found = []
    for name, seed in runs:
        deadline = Deadline(time.perf_counter, PATIENCE, time.perf_counter())
        try:
            rows = ompl_corners(arm, name, start, goals, validity, seed, deadline)
        except PathNotFound:
            continue
        found.append((shorten(rows, validity, seed, deadline), name))
    return found


def _finer(rows: Array) -> Array:
    """With a corner in the middle of every edge."""
    middles = 0.5 * (rows[:-1] + rows[1:])
    finer = np.empty((2 * len(rows) - 1, rows.shape[1]))
    finer[::2], finer[1::2] = rows, middles
    return finer
