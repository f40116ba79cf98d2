"""The smallest box, cylinder, capsule, plate or ball around points, in numbers as a URDF has them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.urdf import Origin, Triple
from gemelo.services.planner.collision_geometry.shapes import matrix_of
from gemelo.tools.collision_fitting.fitted_shape import Fitted, FittedKind
from gemelo.tools.collision_fitting.hull import corners_and_sides, smallest_ball, smallest_rectangle

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
GRID, DIGITS = 1e-5, 5  # [m] to which places are rounded, and half sizes rounded up
THINNEST = 2e-4  # [m] that an edge or a radius has at least
# How much less one shape must hold than another to be taken: what stands along the link's axes is easier to read, and
# what is one element of a URDF.
TURNED, OBLIQUE, SEVERAL = 1.002, 1.02, 1.05
ROUNDEST = math.pi / 4.0  # of a box's volume, that a plate in it has at least
TURNS = np.pi / 8.0 * np.arange(8)
WIDTHS = np.array((np.cos(TURNS), np.sin(TURNS)))  # (2, 8): directions in which a width is measured
UPRIGHT = np.eye(3)[[2, 0, 1]]  # the link's axes; of equal shapes the one along its z is taken


def fitted(points: Array, limit: float = math.inf) -> Fitted:
    """The shape of least volume that holds all `points` (n, 3) [m]; the same points give the same shape.

    A round one that cannot have less than `limit` [m^3] is not looked for.
    """
    corners, sides = corners_and_sides(points)
    best = _box(corners, np.eye(3))
    for axis in np.vstack((UPRIGHT, spread(corners), sides)):
        for each in _along(corners, axis, min(best.volume, limit)):
            best = min(best, each, key=_cost)
    if _least_ball(corners) < OBLIQUE * min(best.volume, limit):
        best = min(best, _ball(corners), key=_cost)
    return best


def axes_of(fitted: Fitted) -> Array:
    """(3, 3) whose rows are the shape's axes in the link."""
    return matrix_of(((0.0, 0.0, 0.0), from_rpy(*fitted.origin.rpy)))[:3, :3].T


def _cost(shape: Fitted) -> float:
    is_oblique = any(abs(math.sin(2.0 * angle)) > 1e-5 for angle in shape.origin.rpy)
    turned = OBLIQUE if is_oblique else TURNED if any(shape.origin.rpy) else 1.0
    return shape.volume * turned * (SEVERAL if len(shape.shapes) > 1 else 1.0)


def spread(points: Array) -> Array:
    """Unit vectors as rows (3, 3): the axes along which points (n, 3) [m] spread, from most to least."""
    return np.asarray(np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2])


def _along(points: Array, axis: Array, best: float) -> Iterator[Fitted]:
    """What is smallest of what has this axis as its z; nothing with a round side that cannot have less than `best`
    [m^3]."""
    turn = _frame(axis)
    for angle in (0.0, smallest_rectangle(points @ turn[:2].T)):
        cosine, sine = np.cos(angle), np.sin(angle)
        along = np.array(((cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0))) @ turn
        box = _box(points, along)
        yield box
        if ROUNDEST * box.volume < OBLIQUE * best:
            yield from _plate(points, along)
    if _least_round(points @ turn.T) < OBLIQUE * best:
        yield from _round(points, turn)


def _least_ball(points: Array) -> float:
    """[m^3] that a ball has at least around points (n, 3)."""
    return math.pi / 6.0 * float(np.ptp(points @ np.hstack((UPRIGHT, spread(points).T)), axis=0).max()) ** 3


def _least_round(there: Array) -> float:
    """[m^3] that a capsule or cylinder along z has at least around points (n, 3)."""
    radius = 0.5 * float(np.ptp(there[:, :2] @ WIDTHS, axis=0).max())
    length = float(np.ptp(there[:, 2]))
    return math.pi * radius**2 * max(length - 2.0 * radius / 3.0, length / 1.5)


def _box(points: Array, turn: Array) -> Fitted:
    rpy, axes = _rounded(turn)
    there = points @ axes.T
    xyz = _place(0.5 * (there.min(axis=0) + there.max(axis=0)) @ axes)
    half = np.abs((points - xyz) @ axes.T).max(axis=0)
    return Fitted(FittedKind.BOX, tuple(2.0 * _up(value) for value in half), Origin(xyz, rpy))


def _plate(points: Array, turn: Array) -> Iterator[Fitted]:
    """With its ends where it is longest, if that is across its z."""
    sizes = np.ptp(points @ turn.T, axis=0)
    if sizes[1] > sizes[0]:
        turn = np.array((turn[1], -turn[0], turn[2]))
    rpy, axes = _rounded(turn)
    there = points @ axes.T
    middle = 0.5 * (there.min(axis=0) + there.max(axis=0))
    caps = _caps(there[:, 1:2] - middle[1], 0.5 * float(np.ptp(there[:, 1])))
    middle[0] = 0.5 * ((there[:, 0] + caps).min() + (there[:, 0] - caps).max())
    xyz = _place(middle @ axes)
    local = (points - xyz) @ axes.T
    half = np.abs(local).max(axis=0)
    radius = _up(float(half[1]))
    straight = float((np.abs(local[:, 0]) - _caps(local[:, 1:2], radius)).max())
    if straight > 0.0:
        yield Fitted(FittedKind.PLATE, (radius, 2.0 * _up(straight), 2.0 * _up(float(half[2]))), Origin(xyz, rpy))


def _round(points: Array, turn: Array) -> Iterator[Fitted]:
    """The cylinder, and the capsule where it is longer than a ball."""
    rpy, axes = _rounded(turn)
    there = points @ axes.T
    centre, radius = smallest_ball(there[:, :2])
    caps = _caps(there[:, :2] - centre, radius)
    flat = 0.5 * (there[:, 2].min() + there[:, 2].max())
    rounded = 0.5 * ((there[:, 2] + caps).min() + (there[:, 2] - caps).max())
    xyz = _place(np.array([*centre, flat]) @ axes)
    local = (points - xyz) @ axes.T
    wide = _up(float(np.linalg.norm(local[:, :2], axis=1).max()))
    yield Fitted(FittedKind.CYLINDER, (wide, 2.0 * _up(float(np.abs(local[:, 2]).max()))), Origin(xyz, rpy))
    xyz = _place(np.array([*centre, rounded]) @ axes)
    local = (points - xyz) @ axes.T
    wide = _up(float(np.linalg.norm(local[:, :2], axis=1).max()))
    straight = float((np.abs(local[:, 2]) - _caps(local[:, :2], wide)).max())
    if straight > 0.0:
        yield Fitted(FittedKind.CAPSULE, (wide, 2.0 * _up(straight)), Origin(xyz, rpy))


def _caps(aside: Array, radius: float) -> Array:
    """(n,) [m] by which a round end reaches beyond the straight part, so far from the axis."""
    return np.asarray(np.sqrt(np.maximum(radius**2 - (aside**2).sum(axis=1), 0.0)))


def _ball(points: Array) -> Fitted:
    xyz = _place(smallest_ball(points)[0])
    return Fitted(FittedKind.SPHERE, (_up(float(np.linalg.norm(points - xyz, axis=1).max())),), Origin(xyz))


def _up(half: float) -> float:
    """Half a size, rounded up, and a little more for what floats lose."""
    return round(max(math.ceil(half / GRID + 1e-4), 0.5 * THINNEST / GRID) * GRID, 9)


def _place(point: Array) -> Triple:
    x, y, z = (round(value, DIGITS) + 0.0 for value in point.tolist())
    return x, y, z


def _frame(axis: Array) -> Array:
    """(3, 3) whose rows are axes, the last of them this one."""
    first = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
    first = first - (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.array((first, np.cross(axis, first), axis))


def _rounded(turn: Array) -> tuple[Triple, Array]:
    """Roll, pitch and yaw [rad] of the frame with these axes, and its axes (3, 3) as they are then."""
    x, y, z = turn
    pitch = math.atan2(-x[2], math.hypot(x[0], x[1]))
    upright = abs(x[2]) > 1.0 - 1e-9
    roll = math.atan2(-z[1], y[1]) if upright else math.atan2(y[2], z[2])
    yaw = 0.0 if upright else math.atan2(x[1], x[0])
    rpy = (round(roll, 6) + 0.0, round(pitch, 6) + 0.0, round(yaw, 6) + 0.0)
    return rpy, matrix_of(((0.0, 0.0, 0.0), from_rpy(*rpy)))[:3, :3].T
