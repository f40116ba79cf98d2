"""Convex hull, smallest ball and smallest rectangle of points: the sizes of a convex shape around them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
FLAT = 1e-6  # thickness as a share of the length below which there is no hull
SIDES = 3  # of the hull's flat sides, the largest
ALIKE = 0.999  # cosine between the normals of one side
SLACK = 1e-9  # of the radius, that a point may be outside
MOST_BALLS = 1000  # some ten are enough
FINENESS, LOOKS = 24, 4  # angles on either side of the best, in each of so many ever finer looks


def corners_and_sides(points: Array) -> tuple[Array, Array]:
    """The corners (m, 3) [m] of the convex hull of `points` (n, 3) [m], and the unit normals (k, 3) of its largest flat
    sides; all points and no normals where the points are flat."""
    points = _apart(points)
    thickness = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[1] if len(points) > 3 else np.zeros(3)
    if thickness[2] <= FLAT * thickness[0]:
        return points, np.zeros((0, 3))
    hull = ConvexHull(points)
    normals, areas = hull.equations[:, :3], _areas(points[hull.simplices])
    sides: list[Array] = []
    while len(sides) < SIDES and areas.any():
        side = normals[int(np.argmax(areas))]
        sides.append(side)
        areas = np.where(np.abs(normals @ side) > ALIKE, 0.0, areas)
    return points[np.sort(hull.vertices)], np.array(sides).reshape(-1, 3)


def _apart(points: Array) -> Array:
    """Points (n, 3) without most of those that are there twice: a fraction of what np.unique takes."""
    along = points[:, 0] + math.sqrt(2.0) * points[:, 1] + math.sqrt(3.0) * points[:, 2]
    order = np.argsort(along, kind="stable")
    is_new = np.concatenate(([True], (np.diff(points[order], axis=0) != 0.0).any(axis=1)))
    return np.asarray(points[order[is_new]])


def _areas(corners: Array) -> Array:
    """(f,) of triangles (f, 3, 3)."""
    sides = corners[:, 1:] - corners[:, :1]
    return np.asarray(0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))


def smallest_ball(points: Array) -> tuple[Array, float]:
    """Centre (d,) and radius of the smallest ball around points (n, d), all [m], however many lie on it.

    That of few points and of the farthest one outside it, until there is none (Gaertner 1999).
    """
    few = points[:1]
    for _ in range(MOST_BALLS):
        centre, radius = _ball(few, few[:0])
        distances = np.linalg.norm(points - centre, axis=1)
        farthest = int(np.argmax(distances))
        if distances[farthest] <= radius * (1.0 + SLACK):
            break
        on_it = np.linalg.norm(few - centre, axis=1) >= radius * (1.0 - SLACK)
        few = np.vstack((few[on_it], points[farthest]))
    return centre, float(distances[farthest])


def _ball(points: Array, border: Array) -> tuple[Array, float]:
    """Of `points`, with all of `border` on it (Welzl 1991)."""
    centre, radius = _through(border) if len(border) else (points[0], 0.0)
    place = 0
    while len(border) <= points.shape[1] and place < len(points):
        distances = np.linalg.norm(points[place:] - centre, axis=1)
        outside = np.flatnonzero(distances > radius * (1.0 + SLACK))
        if not len(outside):
            break
        place += int(outside[0])
        centre, radius = _ball(points[:place], np.vstack((border, points[place])))
        place += 1
    return centre, radius


def _through(border: Array) -> tuple[Array, float]:
    """The smallest ball with these points (1 to d + 1) on it."""
    if len(border) == 2:
        return 0.5 * (border[0] + border[1]), 0.5 * float(np.linalg.norm(border[1] - border[0]))
    sides = border[1:] - border[0]
    off = np.linalg.lstsq(2.0 * sides, (sides**2).sum(axis=1))[0] if len(sides) else np.zeros(border.shape[1])
    return border[0] + off, float(np.linalg.norm(off))


def smallest_rectangle(points: Array) -> float:
    """The angle [rad], to about 1e-5, by which the smallest rectangle around points (n, 2) is turned."""
    best, width = 0.0, np.pi / 4.0
    for _ in range(LOOKS):
        steps = np.linspace(0.0, width, FINENESS + 1)
        angles = best + np.concatenate((steps, -steps[1:]))  # where it makes no difference, none is turned
        along, across = np.array((np.cos(angles), np.sin(angles))), np.array((-np.sin(angles), np.cos(angles)))
        areas = np.ptp(points @ along, axis=0) * np.ptp(points @ across, axis=0)
        best, width = float(angles[int(np.argmin(areas))]), width / FINENESS
    return best
