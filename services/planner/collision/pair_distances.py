"""Coal's distance of one pair of shapes at a time.

Pinocchio knows the few pairs that are looked at in every configuration. To tell it of all the others would take ten
times as long as all else that a scene needs, so what coal needs for one of those is made when it is first looked at.
"""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

from gemelo.services.planner.collision.world_geometry import WorldGeometry
from gemelo.services.planner.request.deadline import NEVER


class PairDistances:
    """Of the pairs of one world; `placed` says where its shapes are now."""

    def __init__(self, geometry: WorldGeometry) -> None:
        self._model, self._pairs, self._known = geometry.model, geometry.pairs, geometry.direct
        self._shapes = geometry.model.geometryObjects
        self._request = coal.DistanceRequest()
        self.deadline = NEVER
        is_mesh = np.array([mesh is not None for mesh in geometry.meshes])
        self._is_slow = np.any(is_mesh[geometry.both], axis=1)
        self._pair: dict[int, tuple[coal.ComputeDistance, coal.DistanceResult]] = {}
        self._poses: list[coal.Transform3s | None] = [None] * len(geometry.boxes)

    def of(self, placed: pin.GeometryData, index: int) -> coal.DistanceResult:
        """The distance of a pair and its nearest points, in the frame of `placed`; raises `PlanRefused` once the
        deadline has passed, for pairs with a mesh: one may take as long as a thousand others."""
        if self._is_slow[index]:
            self.deadline.check()
        if index < self._known:
            return pin.computeDistance(self._model, placed, index)
        distance, result = self._pair.get(index) or self._made(index)
        one, other = self._pairs[index]
        result.clear()
        distance(self._pose(placed, one), self._pose(placed, other), self._request, result)
        return result

    def newest(self, placed: pin.GeometryData, index: int) -> coal.DistanceResult:
        """What was computed last for a pair, which has been asked for before."""
        return placed.distanceResults[index] if index < self._known else self._pair[index][1]

    def _made(self, index: int) -> tuple[coal.ComputeDistance, coal.DistanceResult]:
        one, other = (self._shapes[number].geometry for number in self._pairs[index])
        made = self._pair[index] = coal.ComputeDistance(one, other), coal.DistanceResult()
        return made

    def _pose(self, placed: pin.GeometryData, number: int) -> coal.Transform3s:
        pose, there = self._poses[number], placed.oMg[number]
        if pose is None:
            pose = self._poses[number] = coal.Transform3s()
        pose.setTransform(there.rotation, there.translation)
        return pose
