"""Distances between two links in many configurations: exact only where spheres around the shapes do not settle it."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.joint_mapping import JointMapping
from gemelo.libraries.arm.kinematics.self_collisions import LinkPair, load_collision_geometry
from gemelo.libraries.arm.model.description import ArmDescription

Array = NDArray[np.float64]


class LinkDistances:
    """Of every pair of links that have shapes; `bounds` (m, pairs, 2) [m] are what each is apart at least and at most
    in the configurations (m, n) [rad] or [m]."""

    def __init__(self, arm: ArmDescription, model: pin.Model, mapping: JointMapping, configurations: Array) -> None:
        self._model, self._mapping, self._data = model, mapping, model.createData()
        self._geometry = load_collision_geometry(arm, model)
        self._pairs = self._paired()
        self._placed = self._geometry.createData()
        objects = self._geometry.geometryObjects
        self._joints = np.array([int(each.parentJoint) for each in objects])
        spheres = [_sphere(each) for each in objects]
        self._centres, self._inner = (np.array([sphere[k] for sphere in spheres]) for k in (0, 2))
        self._radii = np.array([sphere[1] for sphere in spheres])
        self.pairs: tuple[LinkPair, ...] = tuple(self._pairs)
        rows = np.array([self._joint_poses(configuration) for configuration in configurations])
        centres, inner = self._moved(rows, self._centres), self._moved(rows, self._inner)
        self.bounds = np.stack([self._bounds(pair, centres, inner) for pair in self.pairs], axis=1)

    def distance(self, pair: LinkPair, positions: Sequence[float] | Array, most: float = math.inf) -> float:
        """[m] between two links, negative inside, or `most` [m] where that is less."""
        q = self._mapping.to_pinocchio(positions)
        pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._placed, q)
        numbers, ones, others = self._pairs[pair]
        poses = self._all_poses()
        centres = self._moved(poses[None], self._centres)[0]
        least = np.linalg.norm(centres[ones] - centres[others], axis=1) - self._radii[ones] - self._radii[others]
        for place in np.argsort(least):
            if least[place] >= most:
                break
            most = min(most, float(pin.computeDistance(self._geometry, self._placed, int(numbers[place])).min_distance))
        return most

    def _paired(self) -> dict[LinkPair, tuple[Array, Array, Array]]:
        """Adds every pair of shapes on different links; their numbers, and those of their shapes, by links."""
        links = [self._model.frames[shape.parentFrame].name for shape in self._geometry.geometryObjects]
        found: dict[LinkPair, list[tuple[int, int, int]]] = defaultdict(list)
        for first in range(len(links)):
            for second in range(first + 1, len(links)):
                if links[first] != links[second]:
                    number = len(self._geometry.collisionPairs)
                    self._geometry.addCollisionPair(pin.CollisionPair(first, second))
                    found[links[first], links[second]].append((number, first, second))
        return {pair: tuple(np.array(rows).T) for pair, rows in found.items()}

    def _joint_poses(self, configuration: Array) -> Array:
        """(joints, 3, 4) in pinocchio's world."""
        pin.forwardKinematics(self._model, self._data, self._mapping.to_pinocchio(configuration))
        return self._all_poses()

    def _all_poses(self) -> Array:
        return np.array([each.homogeneous[:3] for each in self._data.oMi])

    def _moved(self, poses: Array, points: Array) -> Array:
        """(m, shapes, 3) of points (shapes, 3) in their joints' frames, at joint poses (m, joints, 3, 4)."""
        mine = poses[:, self._joints]
        return np.asarray(np.einsum("msij,sj->msi", mine[..., :3], points) + mine[..., 3])

    def _bounds(self, pair: LinkPair, centres: Array, inner: Array) -> Array:
        """(m, 2) from shapes' spheres and from a point in each, both (m, shapes, 3)."""
        _, ones, others = self._pairs[pair]
        least = np.linalg.norm(centres[:, ones] - centres[:, others], axis=2) - self._radii[ones] - self._radii[others]
        most = np.linalg.norm(inner[:, ones] - inner[:, others], axis=2)
        return np.stack((least.min(axis=1), most.min(axis=1)), axis=1)


def _sphere(item: pin.GeometryObject) -> tuple[Array, float, Array]:
    """Centre (3,) and radius [m] of a sphere around a shape, and a point (3,) of the shape, in its joint's frame."""
    geometry = item.geometry
    geometry.computeLocalAABB()
    centre = np.array(geometry.aabb_center)
    inner, radius = centre, float(geometry.aabb_radius)
    if isinstance(geometry, coal.BVHModelBase):
        vertices = np.array(geometry.vertices()).reshape(-1, 3)
        away = np.linalg.norm(vertices - centre, axis=1)
        inner, radius = vertices[int(np.argmin(away))], float(away.max())
    return np.array(item.placement.act(centre)), radius, np.array(item.placement.act(inner))
