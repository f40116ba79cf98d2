"""What the checks of postures are measured on: both arms in a small scene, and the same scene for coal."""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from services.arm.configuration import Configuration
from services.arm.description import Arm
from services.planner.covers.shapes import Shape, ShapeKind

Array = NDArray[np.float64]

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
BOXES = (
    ("table", (1.2, 1.2, 0.02), (0.0, 0.0, -0.02)),
    ("crate", (0.08, 0.08, 0.15), (0.25, 0.10, 0.075)),
    ("block", (0.06, 0.20, 0.20), (-0.20, 0.20, 0.10)),
    ("shelf", (0.20, 0.50, 0.02), (0.36, 0.0, 0.40)),
)
SCENE = tuple(Shape(name, ShapeKind.BOX, size, (place, UPRIGHT)) for name, size, place in BOXES)
SEED = 3


def random_postures(arm: Arm, count: int) -> Array:
    """(count, n) within the limits; the same ones in every run."""
    lower = [max(joint.lower, -np.pi) for joint in arm.joints]
    upper = [min(joint.upper, np.pi) for joint in arm.joints]
    return np.random.default_rng(SEED).uniform(lower, upper, (count, len(arm.joints)))


@dataclass
class CoalChecker:
    """pinocchio and coal on the links' own shapes and the scene's boxes, one posture at a time, until the first hit."""

    arm: Arm

    def __post_init__(self) -> None:
        self._model = pin.buildModelFromUrdf(str(self.arm.urdf_path))
        self._data = self._model.createData()
        self._configuration = Configuration(self.arm, self._model)
        kind = pin.GeometryType.COLLISION
        folder = [str(self.arm.folder)]
        self._geometry = pin.buildGeomFromUrdf(self._model, str(self.arm.urdf_path), kind, package_dirs=folder)
        links = [self._model.frames[item.parentFrame].name for item in self._geometry.geometryObjects]
        moving = [index for index, item in enumerate(self._geometry.geometryObjects) if item.parentJoint != 0]
        for first in range(len(links)):
            for second in range(first + 1, len(links)):
                if links[first] != links[second] and not self.arm.collisions_are_disabled(links[first], links[second]):
                    self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        for name, size, place in BOXES:
            placement = pin.SE3(np.eye(3), np.array(place))
            box = self._geometry.addGeometryObject(pin.GeometryObject(name, 0, 0, placement, coal.Box(*size)))
            for index in moving:
                self._geometry.addCollisionPair(pin.CollisionPair(index, box))
        self._geometry_data = self._geometry.createData()

    def is_free(self, posture: Array) -> bool:
        q = self._configuration.to_pinocchio(posture)
        return not pin.computeCollisions(self._model, self._data, self._geometry, self._geometry_data, q, True)
