"""The shortest path that much computing time allows: many searches, then random shortening of the best.

Lengths are those that the planner's searches minimise: Euclidean, of joint values divided by velocity limits [s at full
speed]. All paths keep the planner's clearance on the exact shapes. For arms of few joints a grid of configurations,
joined where the line is free, decides if any path exists.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.native.paths import NoPath
from gemelo.services.planner.path.path import PathNotFound, Sought
from gemelo.services.planner.path.search import sampled_corners
from gemelo.services.planner.path.smoothing import shorten
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline, Stopwatch, endless
from gemelo.tools.bench.problems.problem_sets import path_length

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

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


def shortest(arm: ArmDescription, checker: CollisionChecker, start: Array, goals: Array) -> tuple[Array, str] | None:
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
    arm: ArmDescription, validity: ValidityChecker, runs: Sequence[tuple[str, int]], start: Array, goals: Array
) -> list[tuple[Array, str]]:
    found = []
    for name, seed in runs:
        deadline = Deadline(time.perf_counter, PATIENCE, time.perf_counter())
        try:
            sought = Sought(arm, start, goals, validity, seed, 1, Stopwatch(endless))
            rows = sampled_corners(sought, name, deadline)
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


Indices = NDArray[np.int64]

STEP = 0.03  # [m] largest movement of any point of the arm between neighbours
NOWHERE = -1  # number of a configuration that is not free


class JointGrid:
    """A grid of configurations within the joint limits, and which of them can be reached from which."""

    def __init__(self, arm: ArmDescription, reach: Array, validity: ValidityChecker) -> None:
        """`reach` (n,) is the largest movement [m] of any point of the arm per unit of each joint."""
        self._axes = [
            np.linspace(joint.lower, joint.upper, 2 + int((joint.upper - joint.lower) * most / STEP))
            for joint, most in zip(arm.joints, reach.tolist(), strict=True)
        ]
        self._validity = validity
        self._shape = tuple(len(axis) for axis in self._axes)
        self._rows = np.stack(np.meshgrid(*self._axes, indexing="ij"), axis=-1)
        rows = self._rows.reshape(-1, len(self._axes))
        self._free = np.array([validity.is_free(row) for row in rows]).reshape(self._shape)
        self._islands = islands(self._free, [self._joined(axis) for axis in range(len(self._axes))])

    def is_connected(self, start: Array, goal: Array) -> bool:
        """True if a path along the grid joins the configurations `start` and `goal` (n,) [rad] or [m]."""
        return not self._islands_at(start).isdisjoint(self._islands_at(goal))

    def _islands_at(self, configuration: Array) -> set[int]:
        """The islands of those corners of its grid cell to which a straight line is free."""
        low = [
            int(np.clip(np.searchsorted(a, v) - 1, 0, len(a) - 2))
            for a, v in zip(self._axes, configuration, strict=True)
        ]
        corners = [
            tuple(i + step for i, step in zip(low, steps, strict=True)) for steps in product((0, 1), repeat=len(low))
        ]
        return {
            int(self._islands[corner])
            for corner in corners
            if self._free[corner] and self._validity.is_line_free(configuration, self._rows[corner])
        }

    def _joined(self, axis: int) -> NDArray[np.bool_]:
        """True for each configuration that a free straight line joins to the next one along `axis`."""
        count = self._shape[axis]
        first, second = (np.take(self._free, range(*ends), axis) for ends in ((0, count - 1), (1, count)))
        joined = first & second
        for index in np.argwhere(joined):
            here = tuple(index)
            there = tuple(index + (np.arange(len(index)) == axis))
            joined[here] = self._validity.is_line_free(self._rows[here], self._rows[there])
        return np.asarray(joined)


def islands(free: NDArray[np.bool_], joined: list[NDArray[np.bool_]]) -> Indices:
    """A number for every configuration of the grid (n, n, ...), equal for those joined; NOWHERE for those not free.

    `free` and the result have the grid's shape; each of `joined` is one shorter along its own axis.
    """
    numbers = np.where(free, np.arange(free.size).reshape(free.shape), free.size)
    while True:
        before = numbers.copy()
        for axis, links in enumerate(joined):
            count = free.shape[axis]
            low = numbers[_part(free.ndim, axis, 0, count - 1)]
            high = numbers[_part(free.ndim, axis, 1, count)]
            least = np.minimum(low, high)
            np.copyto(low, least, where=links)
            np.copyto(high, least, where=links)
        numbers = np.where(free, numbers.reshape(-1)[np.minimum(numbers, free.size - 1)], free.size)
        if np.array_equal(numbers, before):
            return np.asarray(np.where(free, numbers, NOWHERE))


def _part(dimensions: int, axis: int, begin: int, end: int) -> tuple[slice, ...]:
    return tuple(slice(begin, end) if each == axis else slice(None) for each in range(dimensions))
