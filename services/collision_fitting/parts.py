"""A mesh in as few parts as it takes for one shape around each to stand within a bound.

Whatever stands out the farthest is cut in two, by a plane or between whole bodies, where that leaves the least volume:
the best place on each of some axes is found by a sweep as for a tree of boxes (surface area heuristic, with volumes;
Wald 2007). The shapes together hold the mesh and what is inside it (`clipping`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from services.collision_fitting.clipping import clipped, common_corners
from services.collision_fitting.excess import SHARE, ShapeSurface, depth_in, outer_places
from services.collision_fitting.fitted_shape import Fitted
from services.collision_fitting.fitting import axes_of, fitted, spread
from services.collision_fitting.mesh_surface import MeshSurface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
# Of the cuts on all axes, the best by their boxes, that are tried; the second number where the first does not lead to
# the bound. Measured: 7 leave tubes whole that 3 halve lengthwise (44 -> 76 % within the bound), but not every link.
LOOKED_AT = (3, 7)
FILM = 0.002  # [m] added to the boxes' sides, for a flat part takes room as well
MOST_BODIES = 12  # of the largest, that are tried alone against the rest
SLICE, LEAST_GAIN = 1.0 / 6.0, 0.1  # of the length, that is cut off only where it saves so much of the volume
MIDDLE = 0.02  # of the volume, that a cut through the middle is preferred by to one at an end
SAME = 1e-7  # [m] between places that a plane does not part


@dataclass(frozen=True, eq=False)
class _Part:
    """Some triangles (f, 3, 3) [m] with their bodies (f,), the half-spaces (m, 4) that cut them out, places (p, 3) [m]
    spread over them with their bodies (p,)."""

    mesh: MeshSurface
    corners: Array
    body: Numbers
    planes: Array
    places: Array
    places_body: Numbers

    @cached_property
    def fitted(self) -> Fitted:
        """The smallest shape around it."""
        return fitted(self.points)

    @cached_property
    def points(self) -> Array:
        """(n, 3) [m] whose convex hull holds it."""
        inner = common_corners(self.planes)
        if len(inner):
            inner = inner[self.mesh.inside(inner, np.unique(self.body))]
        return np.vstack((self.corners.reshape(-1, 3), inner))

    @cached_property
    def surface(self) -> ShapeSurface:
        """Of the shape around it."""
        return ShapeSurface(self.fitted, self.mesh)

    def below(self, normal: Array, offset: float) -> _Part:
        """What of it is on one side of a plane; `offset` [m]."""
        corners, numbers = clipped(self.corners, normal, offset)
        near = self.places @ normal <= offset
        planes = np.vstack((self.planes, (*normal, offset)))
        return _Part(self.mesh, corners, self.body[numbers], planes, self.places[near], self.places_body[near])

    def only(self, bodies: Numbers) -> _Part:
        """These of its bodies."""
        mine, near = np.isin(self.body, bodies), np.isin(self.places_body, bodies)
        return _Part(
            self.mesh, self.corners[mine], self.body[mine], self.planes, self.places[near], self.places_body[near]
        )


@dataclass(frozen=True)
class _Cut:
    """By a plane, or of `bodies` (k,) from the others; `volume` [m^3] of the boxes around both sides."""

    volume: float
    normal: Array | None = None
    offset: float = 0.0
    bodies: Numbers | None = None

    def sides(self, part: _Part) -> tuple[_Part, _Part]:
        """Of `part`."""
        if self.bodies is not None:
            return part.only(self.bodies), part.only(np.setdiff1d(part.body, self.bodies))
        assert self.normal is not None
        return part.below(self.normal, self.offset), part.below(-self.normal, -self.offset)


def shapes_around(mesh: MeshSurface, within: float, most: int) -> list[Fitted]:
    """At most so many shapes that together hold the mesh, as few as it takes for `SHARE` of their outer surface to be
    within so many [m] of it; the same mesh gives the same shapes."""
    best, most_share = list[_Part](), -1.0
    for looked_at in LOOKED_AT:
        parts, share = _cut_up(mesh, within, most, looked_at)
        if share > most_share:
            best, most_share = parts, share
        if share >= SHARE:
            break
    return [part.fitted for part in _needed(best)]


def _cut_up(mesh: MeshSurface, within: float, most: int, looked_at: int) -> tuple[list[_Part], float]:
    """At most so many parts, and the share of their shapes' outer surface within so many [m] of the mesh."""
    none = np.zeros((0, 4))
    parts = [_Part(mesh, mesh.corners, mesh.body, none, mesh.spread, mesh.spread_body)]
    whole: set[int] = set()  # of the parts that cannot be cut
    far, share = _far_areas(parts, within)
    while len(parts) < most and share < SHARE:
        wanted = [number for number in np.argsort(-far) if far[number] > 0.0 and id(parts[number]) not in whole]
        if not wanted:
            break
        halves = _best_cut(parts[wanted[0]], looked_at)
        if halves is None:
            whole.add(id(parts[wanted[0]]))
        else:
            parts[wanted[0] : wanted[0] + 1] = halves
            far, share = _far_areas(parts, within)
    return parts, share


def _far_areas(parts: Sequence[_Part], within: float) -> tuple[Array, float]:
    """(n,) [m^2] of each part's outer surface that is not within so many [m] of the mesh, and the share that is."""
    masks = outer_places([part.surface for part in parts])
    outer = [part.surface.areas[mask].sum() for part, mask in zip(parts, masks, strict=True)]
    far = [
        part.surface.areas[mask & (part.surface.beyond > within)].sum() for part, mask in zip(parts, masks, strict=True)
    ]
    return np.array(far), 1.0 - float(sum(far) / sum(outer))


def _needed(parts: Sequence[_Part]) -> list[_Part]:
    """Without those that are wholly in another one's convex shape."""
    kept = list(parts)
    for part in sorted(parts, key=lambda each: each.fitted.volume):
        others = (shape for other in kept if other is not part for shape in other.fitted.shapes)
        if any(depth_in([shape], part.points).min() >= 0.0 for shape in others):
            kept.remove(part)
    return kept


def _best_cut(part: _Part, looked_at: int) -> tuple[_Part, _Part] | None:
    """The two sides of the cut after which the shapes are smallest; None where there is nothing to cut."""
    cuts = sorted(_cuts(part), key=lambda cut: cut.volume)[:looked_at]
    sides = [both for both in (cut.sides(part) for cut in cuts) if all(len(side.corners) for side in both)]
    return min(sides, key=lambda both: both[0].fitted.volume + both[1].fitted.volume, default=None)


def _cuts(part: _Part) -> Iterator[_Cut]:
    """Between its bodies, where there are several; else on each axis the best plane."""
    bodies, mine = np.unique(part.places_body, return_inverse=True)
    for turn in (np.eye(3), spread(part.places), axes_of(part.fitted)) if len(part.places) > 1 else ():
        there = part.places @ turn.T
        if len(bodies) > 1:
            yield from _bodies_apart(bodies, mine, there)
        else:
            yield from (cut for axis in range(3) for cut in _best_plane(there, turn[axis], axis))


def _best_plane(there: Array, normal: Array, axis: int) -> Iterator[_Cut]:
    """Across this axis, where the boxes around places (p, 3) on both sides are smallest together: midway between two
    places."""
    order = np.argsort(there[:, axis], kind="stable")
    along = there[order, axis]
    below, above = _boxes(there[order]), _boxes(there[order[::-1]])[::-1]
    volumes = below[:-1] + above[1:]
    aside = np.abs((along[:-1] + along[1:] - along[0] - along[-1]) / max(along[-1] - along[0], SAME))
    is_slice = (aside > 1.0 - 2.0 * SLICE) & (volumes > (1.0 - LEAST_GAIN) * above[0])
    volumes = np.where((np.diff(along) > SAME) & ~is_slice, volumes * (1.0 + MIDDLE * aside), np.inf)
    place = int(np.argmin(volumes))
    if np.isfinite(volumes[place]):
        yield _Cut(float(volumes[place]), normal, 0.5 * float(along[place] + along[place + 1]))


def _boxes(places: Array) -> Array:
    """(p,) [m^3] of the box around the first place, the first two, ..."""
    sides = np.maximum.accumulate(places) - np.minimum.accumulate(places) + FILM
    return np.asarray(sides.prod(axis=1))


def _bodies_apart(bodies: Numbers, mine: Numbers, there: Array) -> Iterator[_Cut]:
    """Each of the largest `bodies` (k,) from the others, and on every axis those before from those behind; place
    `there` (p, 3) is of body number `mine` (p,) among them."""
    low, high = np.full((len(bodies), 3), np.inf), np.full((len(bodies), 3), -np.inf)
    np.minimum.at(low, mine, there)
    np.maximum.at(high, mine, there)
    largest = np.argsort(-(high - low + FILM).prod(axis=1), kind="stable")[:MOST_BODIES]
    groups = [np.array([body]) for body in largest]
    for order in np.argsort(low + high, axis=0, kind="stable").T:
        groups += [order[:count] for count in range(1, len(bodies))]
    for group in groups:
        rest = np.setdiff1d(np.arange(len(bodies)), group)
        volume = sum(float((high[some].max(axis=0) - low[some].min(axis=0) + FILM).prod()) for some in (group, rest))
        yield _Cut(volume, bodies=bodies[group])
