"""What the checks of postures are measured on: both arms in a small scene, and the same scene for coal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from schemas.scene import BoxShape, CylinderShape, PlanningScene, Shape
from services.arm.configuration import Configuration
from services.arm.description import Arm
from services.bench.plan_scenes import TABLE, box

Array = NDArray[np.float64]

SCENE = PlanningScene(
    objects=(
        TABLE,
        box("crate", (0.08, 0.08, 0.15), (0.25, 0.10, 0.075)),
        box("block", (0.06, 0.20, 0.20), (-0.20, 0.20, 0.10)),
        box("shelf", (0.20, 0.50, 0.02), (0.36, 0.0, 0.40)),
    )
)
SEED = 3


def random_postures(arm: Arm, count: int) -> Array:
    """(count, n) anywhere within the limits, within a turn where there are none; the same ones in every run."""
    lower = [joint.lower if math.isfinite(joint.lower) else -math.pi for joint in arm.joints]
    upper = [joint.upper if math.isfinite(joint.upper) else math.pi for joint in arm.joints]
    return np.random.default_rng(SEED).uniform(lower, upper, (count, len(arm.joints)))


@dataclass
class CoalChecker:
    """pinocchio and coal on the links' own shapes and the scene's, one posture at a time, until the first hit."""

    arm: Arm
    scene: PlanningScene

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
        for item in self.scene.objects:
            placement = pin.XYZQUATToSE3(np.array([*item.pose.translation, *item.pose.rotation]))
            solid = pin.GeometryObject(item.name, 0, 0, placement, solid_of(item.shape))
            obstacle = self._geometry.addGeometryObject(solid)
            for index in moving:
                self._geometry.addCollisionPair(pin.CollisionPair(index, obstacle))
        self._geometry_data = self._geometry.createData()

    def is_free(self, posture: Array) -> bool:
        q = self._configuration.to_pinocchio(posture)
        return not pin.computeCollisions(self._model, self._data, self._geometry, self._geometry_data, q, True)


def solid_of(shape: Shape) -> coal.CollisionGeometry:
    """As coal has it; the bench's scenes have these."""
    match shape:
        case BoxShape(size=size):
            return coal.Box(*size)
        case CylinderShape(radius=radius, length=length):
            return coal.Cylinder(radius, length)
    raise ValueError(f"the bench's scenes have boxes and cylinders, not {shape}")
