"""Distances between the links of an arm, by pinocchio and coal alone."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from gemelo.libraries.arm.model.description import ArmDescription


def nearest_distances(arm: ArmDescription, configurations: Iterable[np.ndarray]) -> dict[frozenset[str], float]:
    """[m] of every pair of links with collision shapes; negative where they have touched."""
    model = pin.buildModelFromUrdf(str(arm.urdf_path))
    geometry = pin.buildGeomFromUrdf(model, str(arm.urdf_path), pin.GeometryType.COLLISION)
    links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    geometry.addAllCollisionPairs()
    data, geometry_data = model.createData(), geometry.createData()
    nearest: dict[frozenset[str], float] = {}
    for q in configurations:
        pin.computeDistances(model, data, geometry, geometry_data, q)
        for pair, result in zip(geometry.collisionPairs, geometry_data.distanceResults, strict=True):
            key = frozenset((links[pair.first], links[pair.second]))
            nearest[key] = min(nearest.get(key, 1.0), result.min_distance)
    return nearest
