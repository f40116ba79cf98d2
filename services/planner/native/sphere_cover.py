"""Spheres that cover a solid: every point of it is in one of them, and none bulges out by more than is allowed.

The solid is cut into cells, small ones at its surface, and each cell is in a ball. A sphere at depth d in a solid may
have the radius d + bulge. Greedily (native/src/cover.h), the sphere that holds the most cells not yet held is taken,
and shrunk to what it is needed for. The same solid gives the same spheres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.collision_geometry.link_shapes import solid_of
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind
from gemelo.services.planner.collision_geometry.solids import PROJECTIONS, Capsule, ConvexSolid, Polytope
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.model_cache import cached_rows

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
BULGE = 0.005  # [m] measured: spheres, time and free share for 3, 5 and 10 mm are in README.md
FINENESS = 0.75  # a surface cell's edge as a share of the bulge; its ball must be smaller than the smallest sphere
MESH_FINENESS = 0.28  # the same for a mesh: half a cell's diagonal is lost on either side of its surface
MESH_LOOK = 32  # cells along a mesh's longest side, by which the size of the others is chosen
MOST_MESH_CELLS = 150_000  # of a mesh; a larger one has larger cells, and more bulge
MOST_CANDIDATES = 15_000  # centres of spheres; else of those at the surface, then of all, one in eight is tried
LEVELS = 3  # times that cells are halved from the coarsest to those at the surface
DEEP = 2.5  # balls deep: such a cell is not halved; chosen: no ball reaches through so much to the surface
MOST_SPHERES = 1500  # of a link: those of rm1 and parol6 together have less
LOOK = 20.0  # parts of a link's longest side: the bulge with which its spheres are counted first
GROWTH = 2.0  # measured: spheres increase by at most this power of how much less they may bulge
MEDIAL = 0.9  # the slope of the depth below which a point has several nearest ones on the surface


@dataclass(frozen=True)
class SphereCover:
    """`spheres` (n, 4): centres and radii [m]; `bulge` [m]: how far the farthest one reaches beyond the solid."""

    spheres: Array
    bulge: float


@dataclass(frozen=True)
class CompiledPolytope:
    """A polytope that is asked in C++, in a tenth of the time."""

    polytope: Polytope

    @property
    def half(self) -> Array:
        """(3,) half sizes [m] of the box around it."""
        return self.polytope.half

    def depth(self, points: Array) -> Array:
        """(...) [m] at `points` (..., 3), as `Polytope.depth`."""
        return motion.depths(self._sides, _rows(points)).reshape(points.shape[:-1])

    def nearest(self, points: Array) -> Array:
        """(..., 3) [m] for `points` (..., 3), as `Polytope.nearest`."""
        return motion.projected(self._sides, _rows(points), PROJECTIONS).reshape(points.shape)

    @cached_property
    def _sides(self) -> Array:
        return np.array(self.polytope.planes)


def _rows(points: Array) -> Array:
    """(n, 3) of points (..., 3)."""
    return np.ascontiguousarray(points.reshape(-1, 3))


def cover_shapes(shapes: Sequence[CollisionShape], bulge: float) -> SphereCover:
    """The spheres [m] of several shapes, in the frame of their poses, for a bulge of at most `bulge` [m] but for large
    meshes; raises ValueError for a shape without an end."""
    covers = [_placed(shape, bulge) for shape in shapes]
    return SphereCover(np.vstack([cover.spheres for cover in covers]), max(cover.bulge for cover in covers))


def link_cover(shapes: Sequence[CollisionShape], bulge: float) -> SphereCover:
    """As `cover_shapes`, with more than `bulge` [m] for large links: as much as leaves some `MOST_SPHERES` spheres."""
    look = longest_side(shapes) / LOOK
    if look <= bulge:
        return cover_shapes(shapes, bulge)
    count = len(cover_shapes(shapes, look).spheres)
    return cover_shapes(shapes, max(bulge, look * (count / MOST_SPHERES) ** (1.0 / GROWTH)))


def longest_side(shapes: Sequence[CollisionShape]) -> float:
    """[m] of the box around all of them, along the axes of their frame."""
    corners = [_corners(shape) for shape in shapes]
    low, high = np.min([each[0] for each in corners], axis=0), np.max([each[1] for each in corners], axis=0)
    return float((high - low).max())


def _corners(shape: CollisionShape) -> Array:
    """(2, 3) [m] of a box around the shape in the frame of its pose; raises ValueError for a shape without an end."""
    if shape.mesh is not None:
        points = shape.mesh.vertices @ shape.rotation.T + shape.pose[0]
        return np.array((points.min(axis=0), points.max(axis=0)))
    half = np.abs(shape.rotation) @ solid_of(shape).half
    return np.array((shape.pose[0] - half, shape.pose[0] + half))


def _placed(shape: CollisionShape, bulge: float) -> SphereCover:
    cover = kept_cover(shape, bulge)
    spheres = cover.spheres.copy()
    spheres[:, :3] = spheres[:, :3] @ shape.rotation.T + shape.pose[0]
    spheres[:, 3] += shape.padding
    return SphereCover(spheres, cover.bulge)


def kept_cover(shape: CollisionShape, bulge: float) -> SphereCover:
    """The spheres [m] of a shape about its own origin, from the disk where they have been made before."""
    if shape.mesh is None or shape.kind is ShapeKind.HULL:
        return kept_solid(solid_of(shape), bulge)
    vertices, faces = shape.mesh.arrays
    content = b"".join(
        (np.float64(bulge).tobytes(), np.int64(len(vertices)).tobytes(), vertices.tobytes(), faces.tobytes())
    )
    rows = cached_rows(content, lambda: _as_rows(mesh_cover(vertices, faces, bulge)))
    return SphereCover(rows[:-1], float(rows[-1, 0]))


@lru_cache(maxsize=256)
def kept_solid(solid: ConvexSolid, bulge: float) -> SphereCover:
    """As `kept_cover`, of a solid whose spheres may reach `bulge` [m] beyond it; the newest are also kept in memory."""
    rows = cached_rows(f"{solid} {bulge}".encode(), lambda: _as_rows(cover_of(solid, bulge)))
    return SphereCover(rows[:-1], float(rows[-1, 0]))


def _as_rows(cover: SphereCover) -> Array:
    """(n + 1, 4) the spheres, and the bulge in the last row."""
    return np.vstack((cover.spheres, (cover.bulge, 0.0, 0.0, 0.0)))


def cover_of(solid: ConvexSolid, bulge: float = BULGE) -> SphereCover:
    """The spheres [m] of a convex solid in its own frame, which reach at most `bulge` [m] beyond it."""
    if isinstance(solid, Capsule) and solid.half_length == 0.0:
        return SphereCover(np.array([[0.0, 0.0, 0.0, solid.radius]]), 0.0)
    if isinstance(solid, Polytope):
        solid = CompiledPolytope(solid)
    cells = cells_of(solid, FINENESS * bulge)
    centres = medial(solid, FINENESS * bulge)
    candidates = with_radii(centres, np.maximum(solid.depth(centres), 0.0) + bulge)
    spheres = _chosen(cells, candidates, bulge)
    return SphereCover(spheres, float((spheres[:, 3] - solid.depth(spheres[:, :3])).max()))


def mesh_cover(vertices: Array, faces: NDArray[np.int32], bulge: float = BULGE) -> SphereCover:
    """The spheres [m] of what the mesh `vertices` (v, 3) [m], `faces` (f, 3) encloses, and of its surface.

    The bulge [m] is larger for a large mesh, and is a bound here: of a cell at the surface only the cell is known.
    """
    pitch = _mesh_pitch(vertices, faces, MESH_FINENESS * bulge)
    bulge = max(bulge, pitch / MESH_FINENESS)
    rows = motion.solid_cells(vertices, faces, pitch)
    radius = 0.5 * math.sqrt(3.0) * pitch
    promised = rows[:, 3]  # for any point of a cell; half a diagonal more for its centre
    depths = np.where(promised > 0.0, promised + radius, np.where(promised < 0.0, -radius, 0.0))
    cells = with_radii(rows[:, :3], np.full(len(rows), radius * (1.0 + 1e-9)))
    middle = _medial_cells(rows[:, :3], depths, pitch)
    is_second = (_lattice_places(rows[:, :3], pitch) % 2 == 0).all(axis=1)
    for of_kind in (depths <= 0.0, depths > 0.0):  # the axis of what is round may lie between every second ones
        if np.count_nonzero(middle) > MOST_CANDIDATES:
            middle &= is_second | ~of_kind
    candidates = with_radii(rows[middle, :3], depths[middle] + bulge)
    return SphereCover(_chosen(cells, candidates, bulge - radius), bulge)


def _mesh_pitch(vertices: Array, faces: NDArray[np.int32], least: float) -> float:
    """[m] the edge of a mesh's cells: `least`, or as much more as leaves no more than `MOST_MESH_CELLS` of them."""
    look = float(np.ptp(vertices, axis=0).max()) / MESH_LOOK
    count = len(motion.solid_cells(vertices, faces, look)) if look > least else 0
    return max(least, look * math.cbrt(count / MOST_MESH_CELLS))


def _medial_cells(centres: Array, depths: Array, pitch: float) -> NDArray[np.bool_]:
    """(m,) True for the cells (m, 3) of a lattice, `pitch` [m] apart, that are at the medial axis, as in `medial`."""
    places = tuple(_lattice_places(centres, pitch).T + 1)
    field = np.full([int(place.max()) + 2 for place in places], depths.min() - pitch)
    field[places] = depths
    slopes: Array = np.linalg.norm(np.gradient(field, pitch), axis=0)
    return np.asarray(slopes[places] < MEDIAL)


def _lattice_places(centres: Array, pitch: float) -> NDArray[np.int_]:
    """(m, 3) the places, from 0, of cells (m, 3) of a lattice, `pitch` [m] apart."""
    return np.asarray(np.rint((centres - centres.min(axis=0)) / pitch).astype(int))


def _chosen(cells: Array, candidates: Array, least: float) -> Array:
    """(n, 4) spheres that hold all cells."""
    return motion.cover(cells, candidates, least)


def cells_of(solid: ConvexSolid, pitch: float) -> Array:
    """(m, 4) balls that together hold the solid: cells of at most `pitch` [m] at the surface, larger ones deep inside.

    A cell whose centre lies outside is held by the ball around the solid's nearest point: projection on a convex
    solid never brings points farther apart.
    """
    counts = np.ceil(2.0 * solid.half / (pitch * 2**LEVELS)).astype(int)
    steps = 2.0 * solid.half / counts
    centres = lattice(solid.half, steps)
    points, radii = [], []
    for level in range(LEVELS + 1):
        radius = 0.5 * float(np.linalg.norm(steps)) * (1.0 + 1e-9)
        depth = solid.depth(centres)
        done = depth >= DEEP * radius if level < LEVELS else depth >= -radius
        points.append(solid.nearest(centres[done]))
        radii.append(np.full(int(done.sum()), radius))
        steps = 0.5 * steps
        corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * steps
        centres = (centres[~done & (depth >= -radius)][:, None, :] + corners).reshape(-1, 3)
    return with_radii(np.vstack(points), np.concatenate(radii))


def medial(solid: ConvexSolid, pitch: float) -> Array:
    """Points (k, 3) [m] of a lattice, at most `pitch` [m] apart along each axis, at the solid's medial axis.

    Any sphere of the same bulge is in one around them: away from the nearest point of the surface the depth grows by as
    much as one moves, and so spheres grow around one another, until a second point of the surface is as near.
    """
    counts = np.ceil(2.0 * solid.half / pitch).astype(int) | 1  # odd: some points are on planes of symmetry
    steps = 2.0 * solid.half / counts
    points = lattice(solid.half, steps)
    reach = 0.5 * steps
    shifts = np.diag(reach)
    slopes = [(solid.depth(points + shifts[i]) - solid.depth(points - shifts[i])) / (2.0 * reach[i]) for i in range(3)]
    chosen: Array = points[(np.linalg.norm(slopes, axis=0) < MEDIAL) & (solid.depth(points) > 0.0)]
    return chosen


def lattice(half: Array, steps: Array) -> Array:
    """Centres (n, 3) [m] of the cells of the sizes `steps` (3,) [m] that a box of the half sizes `half` (3,) [m] is cut
    into."""
    axes = [np.arange(0.5 * steps[i] - half[i], half[i], steps[i]) for i in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def with_radii(points: Array, radii: Array) -> Array:
    """Spheres (n, 4) [m]: `points` (n, 3) and `radii` (n,) side by side."""
    return np.ascontiguousarray(np.column_stack((points, radii)))
