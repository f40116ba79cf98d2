"""A part of a mesh: what half-spaces leave of some of its bodies, and the shape around that."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.tools.collision_fitting.clipping import clipped, common_corners, heights_of
from gemelo.tools.collision_fitting.enclosing_hull import enclosing_hull
from gemelo.tools.collision_fitting.excess import SHARE, ShapeSurface, depth_in
from gemelo.tools.collision_fitting.fitted_shape import Fitted
from gemelo.tools.collision_fitting.fitting import fitted
from gemelo.tools.collision_fitting.hull import corners_and_sides
from gemelo.tools.collision_fitting.mesh_surface import MeshSurface

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
LARGER = 1.15  # than a hull, that a box or what is round may be in its stead
MUCH = 0.01  # of the surface, that a hull has more within the bound than what is taken in its stead


class Along(NamedTuple):
    """Of triangles along a normal [m]: `heights` (f, 3) of their corners, and the least and the most (f,) of each."""

    heights: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Some triangles (f, 3, 3) [m] with their bodies (f,), the half-spaces (m, 4) that cut them out, places (p, 3) [m]
    spread over them with their bodies (p,)."""

    mesh: MeshSurface
    within: float  # [m]
    corners: Array
    body: Numbers
    planes: Array
    places: Array
    places_body: Numbers

    @cached_property
    def surface(self) -> ShapeSurface:
        """Of the shape around it: a hull, or one of few numbers where that is within the bound or no worse than the
        hull, and hardly larger."""
        hull = enclosing_hull(self.points, self.planes[:, :3])
        if hull is None:
            return ShapeSurface(fitted(self.points), self.mesh)
        simple = fitted(self.points, LARGER * hull.volume)
        if simple.volume > LARGER * hull.volume:
            return ShapeSurface(hull, self.mesh)
        surface, other = ShapeSurface(simple, self.mesh), ShapeSurface(hull, self.mesh)
        least = min(SHARE, other.share_within(self.within) - MUCH)
        return surface if surface.share_within(self.within) >= least else other

    @property
    def fitted(self) -> Fitted:
        """The shape around it."""
        return self.surface.fitted

    @cached_property
    def points(self) -> Array:
        """(n, 3) [m] the corners of its convex hull."""
        inner = common_corners(self.planes)
        if len(inner):
            inner = inner[self.mesh.inside(inner, np.unique(self.body))]
        return corners_and_sides(np.vstack((self.corners.reshape(-1, 3), inner)))[0]

    @cached_property
    def _along(self) -> dict[bytes, Along]:
        return {}

    def along(self, normal: Array) -> Along:
        """Its triangles along a normal (3,), kept: many planes across one axis are tried."""
        key = normal.tobytes()
        if key not in self._along:
            heights = heights_of(self.corners, normal)
            first, second, third = heights.T  # three columns: the reductions of rows of three take ten times as long
            low, high = (each(each(first, second), third) for each in (np.minimum, np.maximum))
            self._along[key] = Along(heights, low, high)
        return self._along[key]

    def holds(self, other: MeshPart) -> bool:
        """True if one convex shape of this part's holds all of the other part."""
        return any(depth_in([shape], other.points).min() >= 0.0 for shape in self.fitted.shapes)

    def below(self, normal: Array, offset: float) -> MeshPart:
        """What of it is on one side of a plane; `offset` [m]."""
        corners, numbers = clipped(self.corners, normal, offset)
        near = self.places @ normal <= offset
        planes = np.vstack((self.planes, (*normal, offset)))
        body = self.body[numbers]
        return MeshPart(self.mesh, self.within, corners, body, planes, self.places[near], self.places_body[near])

    def only(self, bodies: Numbers) -> MeshPart:
        """These of its bodies."""
        mine, near = np.isin(self.body, bodies), np.isin(self.places_body, bodies)
        places, places_body = self.places[near], self.places_body[near]
        return MeshPart(self.mesh, self.within, self.corners[mine], self.body[mine], self.planes, places, places_body)
