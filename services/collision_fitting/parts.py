"""A mesh in few parts that one shape each holds well: cut where that leaves the least volume, while it is worth it.

A cut is the best place on the best of some axes, found by a sweep as for a tree of boxes (surface area heuristic, with
volumes; Wald 2007): between triangles, none of which is cut itself, or between whole bodies. Two convex shapes around
the two sides of a closed surface hold what is inside it as well: any film across the border lies in both.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from services.collision_fitting.fitted_shape import Fitted
from services.collision_fitting.fitting import fitted, spread
from services.planner.collision_geometry.shapes import TriangleMesh

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Cut = tuple[float, NDArray[np.bool_]]

# Tuning constants: chosen, where a line does not say measured or standard.
LEAST_GAIN = 0.02  # of the volume so far, that one more shape must save
FINEST = 1.0 / 20.0  # of the longest side: longer edges are halved, so that large triangles can be parted
LOOKED_AT = 4  # of the cuts on all axes, the best by their boxes
FILM = 0.002  # [m] added to the boxes' sides, for a flat part takes room as well
SAME = 1e-9  # [m] between places that are not told apart


@dataclass(frozen=True)
class _Pieces:
    """Triangles: `corners` (f, 3, 3) [m], and the body (f,) that each belongs to."""

    corners: Array
    body: Numbers

    def only(self, which: NDArray[np.bool_]) -> _Pieces:
        """The triangles for which `which` (f,) is True; corners in [m]."""
        return _Pieces(self.corners[which], self.body[which])


@dataclass(frozen=True)
class _Part:
    """Some triangles, and the shape around them."""

    pieces: _Pieces
    fitted: Fitted


def shapes_around(mesh: TriangleMesh, most: int) -> list[Fitted]:
    """At most so many shapes that together hold the mesh [m]; the same mesh gives the same shapes."""
    parts = [_part(_pieces(mesh))]
    cuts = [_best_cut(parts[0])]
    while len(parts) < most:
        gains = [part.fitted.volume - _volume(cut) for part, cut in zip(parts, cuts, strict=True)]
        place = int(np.argmax(gains))
        if gains[place] < LEAST_GAIN * _volume(parts):
            break
        halves = cuts[place]
        parts[place : place + 1] = halves
        cuts[place : place + 1] = [_best_cut(half) for half in halves]
    return [part.fitted for part in parts]


def _part(pieces: _Pieces) -> _Part:
    return _Part(pieces, fitted(pieces.corners.reshape(-1, 3)))


def _volume(parts: list[_Part]) -> float:
    return sum(part.fitted.volume for part in parts) if parts else np.inf


def _pieces(mesh: TriangleMesh) -> _Pieces:
    """None with a long edge; corners at one place are one, whatever normals they have in the file."""
    places, numbers = np.unique(np.round(mesh.vertices / SAME), axis=0, return_inverse=True)
    edges = numbers.reshape(-1)[mesh.faces][:, [[0, 1], [1, 2]]].reshape(-1, 2)
    body = trimesh.graph.connected_component_labels(edges, len(places))[edges[::2, 0]]
    pieces = _Pieces(mesh.vertices[mesh.faces], body)
    longest = FINEST * float(np.ptp(mesh.vertices, axis=0).max())
    while (long := _lengths(pieces.corners).max(axis=1) > longest).any():
        halves = _halves(pieces.corners[long])
        kept = pieces.only(~long)
        corners, body = np.concatenate((kept.corners, *halves)), pieces.body[long]
        pieces = _Pieces(corners, np.concatenate((kept.body, body, body)))
    return pieces


def _lengths(corners: Array) -> Array:
    """(f, 3) [m] of the edges, each from a corner to the next."""
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))


def _halves(corners: Array) -> tuple[Array, Array]:
    """Each triangle cut from the middle of its longest edge."""
    rows = np.arange(len(corners))
    first = _lengths(corners).argmax(axis=1)
    a, b, c = (corners[rows, (first + step) % 3] for step in range(3))
    middle = 0.5 * (a + b)
    return np.stack((a, middle, c), axis=1), np.stack((middle, b, c), axis=1)


def _best_cut(part: _Part) -> list[_Part]:
    """The two sides of the cut after which the shapes are smallest; none where there is nothing to cut."""
    cuts = sorted(_cuts(part.pieces), key=lambda cut: cut[0])[:LOOKED_AT]
    sides = [[_part(part.pieces.only(side)) for side in (below, ~below)] for _, below in cuts]
    return min(sides, key=_volume, default=[])


def _cuts(pieces: _Pieces) -> Iterator[Cut]:
    """On each axis, between triangles and between bodies."""
    for turn in (np.eye(3), spread(pieces.corners.reshape(-1, 3))):
        there = pieces.corners @ turn.T
        lows, highs, middles = there.min(axis=1), there.max(axis=1), there.mean(axis=1)
        for along in (*middles.T, *_middles(pieces.body, lows, highs).T):
            yield from _cut(lows, highs, along)


def _middles(body: Numbers, lows: Array, highs: Array) -> Array:
    """(f, 3) the middle of the body that each triangle belongs to."""
    order = np.argsort(body, kind="stable")
    starts = np.flatnonzero(np.diff(body[order], prepend=-1))
    low, high = np.minimum.reduceat(lows[order], starts), np.maximum.reduceat(highs[order], starts)
    return np.asarray(0.5 * (low + high)[np.searchsorted(body[order][starts], body)])


def _cut(lows: Array, highs: Array, along: Array) -> Iterator[Cut]:
    """Where the boxes around both sides are smallest together: their volume [m^3], and what is below."""
    order = np.argsort(along, kind="stable")
    below = _boxes(lows[order], highs[order])[:-1]
    above = _boxes(lows[order[::-1]], highs[order[::-1]])[-2::-1]
    volumes = np.where(np.diff(along[order]) > SAME, below + above, np.inf)
    place = int(np.argmin(volumes)) if len(volumes) else 0
    if len(volumes) and np.isfinite(volumes[place]):
        yield float(volumes[place]), along <= along[order[place]]


def _boxes(lows: Array, highs: Array) -> Array:
    """(f,) [m^3] of the box around the first triangle, the first two, ..."""
    sides = np.maximum.accumulate(highs) - np.minimum.accumulate(lows) + FILM
    return np.asarray(sides.prod(axis=1))
