"""The cut of a part of a mesh after which the convex hulls of its sides stand out least (as in convex decompositions;
Lien and Amato 2007, Wei et al. 2022)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from gemelo.tools.collision_fitting.fitting import axes_of, spread
from gemelo.tools.collision_fitting.mesh_part import MeshPart

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
PLACES = 600  # of a part and of a section, that the hulls on both sides of a cut are made of where cuts are compared
LOOKS = 400  # places on such a hull, whose distance from the mesh is looked at
ROUGH = 3  # times fewer of both, by which all cuts are compared first
FINALISTS = 12  # cuts that are compared with all of them
FREE = 0.5  # of the bound, that is not counted there
PROGRESS = 0.03  # of what stands out, that one cut is to save for two at once not to be tried
CUTS = 8  # planes across an axis: as far apart from one another as from the ends
ALIKE = 0.98  # cosine between axes of which one is tried
MOST_BODIES = 12  # of the largest, that are tried alone against the rest
FILM = 0.002  # [m] added to the sides of boxes, for a flat part takes room as well
SLICE, LEAST_GAIN = 1.0 / 6.0, 0.1  # of the length, that is cut off only where it saves so much of the boxes
SAME = 1e-7  # [m] between places that a plane does not part
ON_PLANE = 1e-6  # [m] that a place on a cut is off its plane at most
WEIGHTS = np.random.default_rng(0).dirichlet(np.ones(3), LOOKS)  # (p, 3) where in its triangle each place is


class Outside(NamedTuple):
    """What stands out of the mesh: its distance over its area, and all that a hull holds; [m^3]."""

    beyond: float
    held: float


@dataclass(frozen=True)
class _Cut:
    """By `planes` (k, 4), all of them, or of `bodies` (k,) from the others; how much the hulls of all sides stand out,
    and how much they hold."""

    outside: Outside
    planes: Array | None = None
    bodies: Numbers | None = None

    def sides(self, part: MeshPart) -> list[MeshPart]:
        """Of `part`, those in which there is something."""
        sides = [part]
        if self.bodies is not None:
            return [part.only(self.bodies), part.only(np.setdiff1d(part.body, self.bodies))]
        assert self.planes is not None
        for *normal, offset in self.planes:
            axis = np.array(normal)
            sides = [half for each in sides for half in (each.below(axis, offset), each.below(-axis, -offset))]
        return [side for side in sides if len(side.corners)]


def best_cut(part: MeshPart) -> list[MeshPart] | None:
    """The sides of the cut after which least stands out; None where there is nothing to cut.

    Where no one cut makes much difference, as across a bore, two planes at once are tried too, and what the hulls hold
    counts as well.
    """
    cuts = [*_between_bodies(part), *_planes(part)]
    whole = outside(part, _some(part.places), part.planes)
    least = min((cut.outside.beyond for cut in cuts), default=0.0)
    if least <= (1.0 - PROGRESS) * whole.beyond:
        cuts.sort(key=lambda cut: cut.outside.beyond)
    else:
        cuts = sorted((*cuts, *_crossed(part)), key=lambda cut: sum(cut.outside))
    found = (cut.sides(part) for cut in cuts)
    return next((sides for sides in found if len(sides) > 1), None)


def _between_bodies(part: MeshPart) -> Iterator[_Cut]:
    """Each of the largest bodies from the others, and on every axis those before from those behind: of these cuts the
    best by the boxes around both sides."""
    bodies, mine = np.unique(part.places_body, return_inverse=True)
    low, high = np.full((len(bodies), 3), np.inf), np.full((len(bodies), 3), -np.inf)
    np.minimum.at(low, mine, part.places)
    np.maximum.at(high, mine, part.places)
    groups = [np.array([body]) for body in np.argsort(-_boxes(low, high), kind="stable")[:MOST_BODIES]]
    for order in np.argsort(low + high, axis=0, kind="stable").T:
        groups += [order[:count] for count in range(1, len(bodies))]
    masks = [np.isin(np.arange(len(bodies)), group) for group in groups if len(group) < len(bodies)]
    masks.sort(key=lambda mask: sum(_boxes(low[side].min(axis=0), high[side].max(axis=0)) for side in (mask, ~mask)))
    for mask in masks[:CUTS]:
        both = [_some(part.places[side[mine]]) for side in (mask, ~mask)]
        yield _Cut(_sum(outside(part, places, part.planes) for places in both), bodies=bodies[mask])


def _planes(part: MeshPart) -> Iterator[_Cut]:
    """Across the link's axes, those along which its places spread, and those of its shape: the best by a rough look."""
    if len(part.places) < 2:
        return
    found: list[Array] = []
    for axis, turn in _distinct((np.eye(3), spread(part.places), axes_of(part.fitted))):
        along = part.places @ axis
        even = np.linspace(along.min(), along.max(), CUTS + 2)[1:-1]
        found += [np.array([(*axis, offset)]) for offset in (*even.tolist(), *_step(part.places @ turn.T, along))]
    rough: list[float] = []
    for planes in found:
        enough = sorted(rough)[FINALISTS - 1] if len(rough) >= FINALISTS else np.inf
        rough.append(_cut_by(part, planes, ROUGH, enough).outside.beyond)
    yield from (_cut_by(part, found[number]) for number in np.argsort(rough, kind="stable")[:FINALISTS])


def _crossed(part: MeshPart) -> Iterator[_Cut]:
    """By two planes through the middle, across one another."""
    if len(part.places) < 2:
        return
    for turn in (np.eye(3), spread(part.places)):
        there = part.places @ turn.T
        planes = np.column_stack((turn, 0.5 * (there.min(axis=0) + there.max(axis=0))))
        yield from (_cut_by(part, np.delete(planes, axis, axis=0)) for axis in range(3))


def _cut_by(part: MeshPart, planes: Array, rough: int = 1, enough: float = np.inf) -> _Cut:
    """By all of the planes (k, 4), judged by places on it and in the cuts, so many times fewer where it is `rough`; no
    more sides are looked at once more than `enough` stands out."""
    sections = [_some(_section(part, plane), rough) for plane in planes]
    sides = [np.vstack((_some(part.places, rough), *sections))]
    for *normal, offset in planes:
        heights = [side @ np.array(normal) - offset for side in sides]
        sides = [
            side[sign * height <= SAME] for side, height in zip(sides, heights, strict=True) for sign in (1.0, -1.0)
        ]
    around = np.vstack((part.planes, planes))
    looked_at: list[Outside] = []
    for side in sides:
        looked_at.append(outside(part, side, around, rough))
        if sum(each.beyond for each in looked_at) > enough:
            break
    return _Cut(_sum(looked_at), planes)


def _sum(several: Iterable[Outside]) -> Outside:
    beyond, held = np.sum([(0.0, 0.0), *several], axis=0)
    return Outside(float(beyond), float(held))


def outside(part: MeshPart, places: Array, planes: Array, rough: int = 1) -> Outside:
    """Of the hull of places (n, 3) [m] of the part, without what is on one of the planes (m, 4), where another part
    goes on."""
    try:
        hull = ConvexHull(places)
    except (QhullError, ValueError):  # they are flat, or too few
        return Outside(0.0, 0.0)
    corners = places[hull.simplices]
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.cumsum(0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))
    count = LOOKS // rough
    faces = np.searchsorted(areas, areas[-1] * (np.arange(count) + 0.5) / count)
    looked_at = np.einsum("pc,pcx->px", WEIGHTS[:count], corners[np.minimum(faces, len(corners) - 1)])
    is_outer = (np.abs(looked_at @ planes[:, :3].T - planes[:, 3]) > ON_PLANE).all(axis=1)
    far = np.maximum(part.mesh.near_distances(looked_at[is_outer]) - FREE * part.within, 0.0)
    return Outside(float(far.sum() * areas[-1] / count), float(hull.volume))


def _section(part: MeshPart, plane: Array) -> Array:
    """(k, 3) [m] where edges of the part's triangles cross a plane (4,)."""
    along = part.along(plane[:3])
    crossed = np.flatnonzero((along.low <= plane[3]) & (along.high > plane[3]))
    corners, heights = part.corners[crossed], along.heights[crossed] - plane[3]
    ends, high = np.roll(corners, -1, axis=1), np.roll(heights, -1, axis=1)
    crosses = (heights <= 0.0) != (high <= 0.0)
    share = heights[crosses] / (heights[crosses] - high[crosses])
    return np.asarray(corners[crosses] + share[:, None] * (ends[crosses] - corners[crosses]))


def _step(there: Array, along: Array) -> list[float]:
    """[m] where boxes around places `there` (p, 3) on both sides are smallest, midway between two; none where all are
    at one place `along` (p,) the axis."""
    order = np.argsort(along, kind="stable")
    below, above = _growing(there[order]), _growing(there[order[::-1]])[::-1]
    middles, volumes = 0.5 * (along[order[:-1]] + along[order[1:]]), below[:-1] + above[1:]
    edge = SLICE * float(np.ptp(along))
    is_slice = (middles < along.min() + edge) | (middles > along.max() - edge)
    is_step = (np.diff(along[order]) > SAME) & ~(is_slice & (volumes > (1.0 - LEAST_GAIN) * above[0]))
    place = int(np.argmin(np.where(is_step, volumes, np.inf)))
    return [float(middles[place])] if is_step.any() else []


def _growing(places: Array) -> Array:
    """(p,) [m^3] of the box around the first place, the first two, ..."""
    return _boxes(np.minimum.accumulate(places), np.maximum.accumulate(places))


def _boxes(low: Array, high: Array) -> Array:
    """(...) [m^3] of boxes between corners (..., 3) [m]."""
    return np.asarray((high - low + FILM).prod(axis=-1))


def _distinct(turns: Sequence[Array]) -> list[tuple[Array, Array]]:
    """Their rows, without those that are nearly along one before them, each with the axes (3, 3) that it is one of."""
    found: list[tuple[Array, Array]] = []
    for turn in turns:
        found += [(axis, turn) for axis in turn if all(abs(float(axis @ other)) < ALIKE for other, _ in found)]
    return found


def _some(places: Array, rough: int = 1) -> Array:
    """At most twice `PLACES` of them, or so many times fewer."""
    return places[:: max(1, len(places) * rough // PLACES)]
