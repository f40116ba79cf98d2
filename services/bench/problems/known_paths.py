"""Finds the shortest path that much computing time allows: many searches, then random shortening of the best.

Lengths are those that the planner's searches minimise: Euclidean, of joint values divided by velocity limits [s at full
speed]. All paths keep the planner's clearance on the exact shapes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from services.arm.model.description import Arm
from services.bench.problems.problem_sets import path_length
from services.planner.collision.checker import CollisionChecker
from services.planner.collision.clearance import CLEARANCE
from services.planner.native.paths import NoPath
from services.planner.path.ompl_search import ompl_corners
from services.planner.path.path import PathNotFound
from services.planner.path.smoothing import shorten
from services.planner.path.validity import ValidityChecker
from services.planner.request.deadline import Deadline

if TYPE_CHECKING:
    from services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]

SEEDS = 100  # searches by the compiled core
LONG_RUNS = (("BITstar", 1), ("BITstar", 2), ("RRTstar", 1))  # planner, seed; each is shortened
NARROW_RUNS = (("RRTConnect", 1), ("RRTConnect", 2), ("RRTConnect", 3))  # if the core's spheres find nothing
PATIENCE = 5.0  # [s] for one search
TIGHTENED = 4  # of the shortest paths
PUSHES, LAST_PUSHES = 4000, 400  # of random corners, with the spheres and with the exact shapes
WIDEST, NARROWEST = 0.2, 0.002  # [s at full speed] standard deviation of the first and the last push


class Spheres:
    """The compiled core alone as a collision check: a path touches if the core does not report it free."""

    def __init__(self, core: NativePlanner) -> None:
        self._core = core

    def touching(self, positions: Array, margin: float) -> Array | None:
        """The first of `positions` (m, n) [rad] or [m] if the path through them is not free, else None; the core's own
        margin is kept instead of `margin` [m]."""
        return None if self._core.path_free(positions) else np.asarray(positions[0])


def shortest(arm: Arm, checker: CollisionChecker, start: Array, goals: Array) -> tuple[Array, str] | None:
    """A polyline (m, n) [rad] or [m] from `start` (n,) to one of `goals` (k, n), and what found it; None if none is
    found."""
    core = checker.native(CLEARANCE)
    if core is None:
        raise RuntimeError("the compiled motion core is needed to look for the shortest ways: run `make setup`")
    speeds = np.array([joint.velocity for joint in arm.joints])
    cautious, exact = ValidityChecker(Spheres(core), CLEARANCE), ValidityChecker(checker, CLEARANCE)
    found = _by_core(core, start, goals)
    found += _by_ompl(arm, cautious, LONG_RUNS, start, goals) if found else []
    found = found or _by_ompl(arm, exact, NARROW_RUNS, start, goals)
    found.sort(key=lambda path: path_length(path[0], speeds))
    tight = [
        (tightened(rows, speeds, seed, cautious, PUSHES), name) for seed, (rows, name) in enumerate(found[:TIGHTENED])
    ]
    if not tight:
        return None
    rows, name = min(tight, key=lambda path: path_length(path[0], speeds))
    return tightened(rows, speeds, TIGHTENED, exact, LAST_PUSHES), name


def tightened(rows: Array, speeds: Array, seed: int, validity: ValidityChecker, pushes: int) -> Array:
    """The polyline `rows` (m, n) [rad] or [m] shortened: a corner is added on every edge, then corners are moved at
    random; `speeds` (n,) [rad/s] or [m/s] are the joints' velocity limits."""
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
        is_shorter = path_length(then, speeds) < path_length(now, speeds)
        if is_shorter and validity.is_line_free(before, pushed) and validity.is_line_free(pushed, after):
            rows[corner] = pushed
    return rows


def _by_core(core: NativePlanner, start: Array, goals: Array) -> list[tuple[Array, str]]:
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
    """`rows` (m, n) with a corner in the middle of every edge, (2 m - 1, n)."""
    middles = 0.5 * (rows[:-1] + rows[1:])
    finer = np.empty((2 * len(rows) - 1, rows.shape[1]))
    finer[::2], finer[1::2] = rows, middles
    return finer
