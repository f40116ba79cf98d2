"""Contacts of links as they are drawn: in their visual meshes, to which collision shapes are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.joint_mapping import JointMapping
from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import ArmDescription

Array = NDArray[np.float64]


class DrawnLinks:
    """The links as they are drawn; the files are read where they are first asked for."""

    def __init__(self, arm: ArmDescription, model: pin.Model, mapping: JointMapping) -> None:
        self._arm, self._model, self._mapping = arm, model, mapping

    def come_to_touch(self, pair: LinkPair, nearest: Array, farthest: Array) -> bool:
        """True if two links touch in one of the `nearest` configurations (m, n) [rad] or [m], and are apart in a
        configuration of the `farthest`; also where a link is not drawn, since its collision shape is all that is known
        of it."""
        numbers = [self._numbers(link) for link in pair]
        if not all(numbers):
            return True
        places = [(one, other) for one in numbers[0] for other in numbers[1]]
        return any(self._touch(places, each) for each in nearest) and not all(
            self._touch(places, each) for each in farthest
        )

    def _touch(self, places: Sequence[tuple[int, int]], positions: Array) -> bool:
        checked = self._geometry.copy()
        checked.removeAllCollisionPairs()
        for one, other in places:
            checked.addCollisionPair(pin.CollisionPair(one, other))
        result = checked.createData()
        q = self._mapping.to_pinocchio(positions)
        pin.updateGeometryPlacements(self._model, self._model.createData(), checked, result, q)
        return bool(pin.computeCollisions(checked, result, True))

    def _numbers(self, link: str) -> list[int]:
        shapes = enumerate(self._geometry.geometryObjects)
        return [number for number, shape in shapes if self._model.frames[shape.parentFrame].name == link]

    @cached_property
    def _geometry(self) -> pin.GeometryModel:
        urdf, folders = str(self._arm.urdf_path), [str(self._arm.folder)]
        try:
            return pin.buildGeomFromUrdf(self._model, urdf, pin.GeometryType.VISUAL, package_dirs=folders)
        except (ValueError, RuntimeError):  # of a mesh in a format that pinocchio does not read
            return pin.GeometryModel()
