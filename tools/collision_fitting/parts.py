"""A mesh in as few parts as it takes for one shape around each to stand within a bound.

Whatever stands out the farthest is cut, by planes or between whole bodies (`cuts`). A part gets a box or what is round
where that stands within the bound, else a convex hull with few sides (`mesh_part`). The shapes together hold the mesh
and what is inside it (`clipping`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gemelo.tools.collision_fitting.cuts import best_cut
from gemelo.tools.collision_fitting.excess import SHARE, outer_places
from gemelo.tools.collision_fitting.fitted_shape import Fitted
from gemelo.tools.collision_fitting.mesh_part import MeshPart
from gemelo.tools.collision_fitting.mesh_surface import MeshSurface

Array = NDArray[np.float64]


def shapes_around(mesh: MeshSurface, within: float, most: int) -> list[Fitted]:
    """At most so many shapes that together hold the mesh, as few as it takes for `SHARE` of their outer surface to be
    within so many [m] of it; the same mesh gives the same shapes."""
    none = np.zeros((0, 4))
    parts = [MeshPart(mesh, within, mesh.corners, mesh.body, none, mesh.spread, mesh.spread_body)]
    whole: set[int] = set()  # of the parts that cannot be cut
    far, share = _far_areas(parts, within)
    while len(parts) < most and share < SHARE:
        wanted = [number for number in np.argsort(-far) if far[number] > 0.0 and id(parts[number]) not in whole]
        if not wanted:
            break
        sides = best_cut(parts[wanted[0]])
        if sides is None or len(parts) + len(sides) - 1 > most:
            whole.add(id(parts[wanted[0]]))
        else:
            parts[wanted[0] : wanted[0] + 1] = sides
            far, share = _far_areas(parts, within)
    return [part.fitted for part in _needed(parts)]


def _far_areas(parts: Sequence[MeshPart], within: float) -> tuple[Array, float]:
    """(n,) [m^2] of each part's outer surface that is not within so many [m] of the mesh, and the share that is."""
    masks = outer_places([part.surface for part in parts])
    outer = [part.surface.areas[mask].sum() for part, mask in zip(parts, masks, strict=True)]
    far = [
        part.surface.areas[mask & (part.surface.beyond > within)].sum() for part, mask in zip(parts, masks, strict=True)
    ]
    return np.array(far), 1.0 - float(sum(far) / sum(outer))


def _needed(parts: Sequence[MeshPart]) -> list[MeshPart]:
    """Without those that are wholly in another one's convex shape."""
    kept = list(parts)
    holders = {part: [other for other in parts if other is not part and other.holds(part)] for part in parts}
    for part in sorted(parts, key=lambda each: each.fitted.volume):
        left = [other for other in kept if other is not part]
        if all(any(holder in left for holder in holders[other]) for other in parts if other not in left):
            kept = left
    return kept
