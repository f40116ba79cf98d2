"""Tables of exact distances between links that one or two joints move against one another.

Such a distance depends on one or two numbers alone. Where two links are always near, the spheres around them can never
tell, so coal is asked beforehand: in the middle of a block of joint values, of which then all is known to be as far
apart as that, less what the joints can change within the block (a Lipschitz bound). A block that this says too little
about is cut in four.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.native import compiled
from gemelo.services.planner.native.distance_tables import Axis, JointsBetween, PairTable

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]
LinkDistance = Callable[[Sequence[float]], float]

# Tuning constants: chosen, where a line does not say measured or standard.
CELLS = 128  # along each joint; a power of two, as pair_table.h wants
MOST_JOINTS = 2  # between two links that a table is made of
SAMPLES = 40  # configurations that say whether two links are often near
OFTEN = 0.1  # of them; chosen: of less the spheres tell most
NEAR = 3.0  # times what the spheres of either bulge
ENOUGH = 0.05  # [m] that is not told apart from more: there the spheres can tell
KNOWN = 0.5  # of the distance in its middle that a block is known to keep, before it is cut no further
UNSURE = 2e-5  # [m] of coal's own distances, and more
SEED = 5  # chosen: any will do
CLOSED = 1e-3  # [rad] that a joint may lack to a whole turn


def pair_tables(arm: ArmDescription, planner: NativePlanner) -> list[PairTable]:
    """Of the pairs of links that are too often too near for the planner's spheres: made once for an arm, and kept on
    the disk."""
    pairs = [pair for pair in planner.joints_between if _is_of_use(pair, arm, planner)]
    if not pairs:
        return []
    made = iter(compiled.cached_rows(_content(arm, planner, pairs), lambda: _all_bounds(arm, planner, pairs)).tolist())
    tables = list[PairTable]()
    for pair in pairs:
        rows, columns = int(next(made)), int(next(made))
        if rows:
            bounds = np.array(list(islice(made, rows * columns))).reshape(rows, columns)
            tables.append(PairTable(pair.first, pair.second, _axes(arm, pair), bounds))
    return tables


def _is_of_use(pair: JointsBetween, arm: ArmDescription, planner: NativePlanner) -> bool:
    """True for links whose spheres bulge, with one or two joints between that have ends or go around."""
    is_finite = all(math.isfinite(end) for axis in _axes(arm, pair) for end in (axis.low, axis.high))
    return len(pair.reaches) <= MOST_JOINTS and _bulge(planner, pair) > 0.0 and is_finite


def _bulge(planner: NativePlanner, pair: JointsBetween) -> float:
    return max(planner.covers[pair.first].bulge, planner.covers[pair.second].bulge)


def _all_bounds(arm: ArmDescription, planner: NativePlanner, pairs: Sequence[JointsBetween]) -> Array:
    """Of every pair the number of rows and of columns, and the bounds [m]; without any where there is no need."""
    world, parts = World(arm, Kinematics(arm)), list[Array]()
    for pair in pairs:
        bounds = bounds_of(arm, world, pair, NEAR * _bulge(planner, pair))
        parts += [np.array(bounds.shape, dtype=np.float64), bounds.ravel()]
    return np.concatenate(parts)


def _axes(arm: ArmDescription, pair: JointsBetween) -> tuple[Axis, Axis]:
    """Of both joints, or of one and of nothing."""
    axes = [_axis(arm, drive) for drive in sorted(pair.reaches)]
    first = axes[0]
    return first, axes[1] if len(axes) > 1 else Axis(first.drive, -1e3, 1e3, is_turn=False)


def _axis(arm: ArmDescription, drive: int) -> Axis:
    joint = arm.joints[drive]
    has_followers = any(each.mimic is not None for each in arm.model.joints)
    if joint.unit == "rad" and joint.upper - joint.lower > math.tau - CLOSED and not has_followers:
        return Axis(drive, -math.pi, math.pi, is_turn=True)
    return Axis(drive, joint.lower, joint.upper, is_turn=False)


def bounds_of(arm: ArmDescription, world: World, pair: JointsBetween, near: float) -> Array:
    """(rows, columns) [m] that the links keep at least; empty where they are seldom as `near` [m] as to need that."""
    axes = _axes(arm, pair)
    distance = _distance(arm, world, pair, axes)
    if distance is None or not _is_often_near(distance, axes, near):
        return np.empty((0, 0))
    columns = CELLS if len(pair.reaches) == MOST_JOINTS else 1
    bounds = np.empty((CELLS, columns))
    steps = [(axis.high - axis.low) / count for axis, count in zip(axes, (CELLS, columns), strict=True)]
    changes = [pair.reaches[axis.drive] * step for axis, step in zip(axes, steps, strict=True)]
    if columns == 1:
        changes[1] = 0.0
    waiting = [(0, 0, CELLS, columns)]
    while waiting:
        row, column, high, wide = waiting.pop()
        middle = [axis.low + step * (at + 0.5 * size) for axis, step, at, size in
                  zip(axes, steps, (row, column), (high, wide), strict=True)]  # fmt: skip
        here = distance(middle)
        change = 0.5 * (changes[0] * high + changes[1] * wide)
        is_known = here - change >= min(ENOUGH, KNOWN * here) if here > 0.0 else here + change <= 0.0
        if is_known or high == 1:
            bounds[row : row + high, column : column + wide] = here - change - UNSURE
            continue
        waiting += _quarters(row, column, high, wide)
    return bounds


def _quarters(row: int, column: int, high: int, wide: int) -> Iterator[tuple[int, int, int, int]]:
    half, narrow = high // 2, max(1, wide // 2)
    for below in (row, row + half):
        for right in range(column, column + wide, narrow):
            yield below, right, half, narrow


def _is_often_near(distance: LinkDistance, axes: tuple[Axis, Axis], near: float) -> bool:
    random = np.random.default_rng(SEED)
    rows = random.uniform([axis.low for axis in axes], [axis.high for axis in axes], (SAMPLES, 2))
    return sum(0.0 < distance(row.tolist()) < near for row in rows) >= OFTEN * SAMPLES


def _distance(arm: ArmDescription, world: World, pair: JointsBetween, axes: tuple[Axis, Axis]) -> LinkDistance | None:
    """[m] between the two links at the values of both joints, by coal; None where they are not checked."""
    names = {(pair.first, pair.second), (pair.second, pair.first)}
    numbers = [number for number, name in enumerate(world.pair_names) if name in names]
    if not numbers:
        return None
    joints = [min(max(0.0, joint.lower), joint.upper) for joint in arm.joints]

    def distance(values: Sequence[float]) -> float:
        for axis, value in zip(reversed(axes), reversed(values), strict=True):
            joints[axis.drive] = value
        return float(world.distances(joints, numbers).min())

    return distance


def _content(arm: ArmDescription, planner: NativePlanner, pairs: Sequence[JointsBetween]) -> bytes:
    """All that the tables depend on."""
    links = sorted({link for pair in pairs for link in (pair.first, pair.second)})
    parts = [arm.urdf_path.read_bytes(), Path(__file__).read_bytes(), *(planner.contents[link] for link in links)]
    parts += [repr((pair, _axes(arm, pair), _bulge(planner, pair))).encode() for pair in pairs]
    return b"pair tables" + b"".join(hashlib.sha256(part).digest() for part in parts)
