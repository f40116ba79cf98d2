"""The reference: pinocchio and coal on the links' own geometry, in doubles, one configuration at a time."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.joint_mapping import JointMapping
from gemelo.libraries.arm.kinematics.kinematics import frame_of_link
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision_geometry.coal_shapes import hull_around
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind

Array = NDArray[np.float64]


class Truth:
    """Distances of an arm to itself and to `shapes`, whose poses are in the arm's base."""

    def __init__(self, arm: ArmDescription, shapes: Sequence[CollisionShape] = ()) -> None:
        self._model = pin.buildModelFromUrdf(str(arm.urdf_path))
        self._data = self._model.createData()
        self._configuration = JointMapping(arm, self._model)
        kind = pin.GeometryType.COLLISION
        self._geometry = pin.buildGeomFromUrdf(self._model, str(arm.urdf_path), kind, package_dirs=[str(arm.folder)])
        self._geometry.removeAllCollisionPairs()
        links = [self._model.frames[item.parentFrame].name for item in self._geometry.geometryObjects]
        moving = [item.parentJoint != 0 for item in self._geometry.geometryObjects]
        base = self._model.frames[frame_of_link(self._model, arm.base_frame)].placement
        for first in range(len(links)):
            for second in range(first + 1, len(links)):
                if links[first] != links[second] and not arm.collisions_are_disabled(links[first], links[second]):
                    self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        for shape in shapes:
            placement = base * pin.SE3(shape.matrix)
            item = self._geometry.addGeometryObject(pin.GeometryObject(shape.name, 0, 0, placement, solid_of(shape)))
            for index, link in enumerate(links):
                if moving[index] and link not in shape.touching:
                    self._geometry.addCollisionPair(pin.CollisionPair(index, item))
        self._geometry_data = self._geometry.createData()

    def distance(self, positions: Sequence[float] | Array) -> float:
        """[m] of the nearest pair."""
        q = self._configuration.to_pinocchio(np.asarray(positions))
        pin.computeDistances(self._model, self._data, self._geometry, self._geometry_data, q)
        return float(min(result.min_distance for result in self._geometry_data.distanceResults))


def solid_of(shape: CollisionShape) -> coal.CollisionGeometry:
    size = shape.size
    match shape.kind:
        case ShapeKind.BOX:
            return coal.Box(*size)
        case ShapeKind.SPHERE:
            return coal.Sphere(*size)
        case ShapeKind.CYLINDER:
            return coal.Cylinder(*size)
        case ShapeKind.CAPSULE:
            return coal.Capsule(*size)
        case ShapeKind.HALF_SPACE:
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        case ShapeKind.MESH:
            model = coal.BVHModelOBBRSS()
            assert shape.mesh is not None
            vertices, faces = shape.mesh.arrays
            model.beginModel(len(faces), len(vertices))
            model.addVertices(vertices)
            for face in faces.tolist():
                model.addTriangle(*vertices[face])
            model.endModel()
            return model
        case ShapeKind.HULL:
            assert shape.mesh is not None
            return hull_around(shape.mesh)
