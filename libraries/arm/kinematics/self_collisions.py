"""Self-collision checks by coal on the URDF's collision geometry, without the pairs that the SRDF disables."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import wrong_file
from gemelo.libraries.arm.kinematics.convex_meshes import convex_or_same
from gemelo.libraries.arm.kinematics.joint_mapping import JointMapping
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import because, remedy

Array = NDArray[np.float64]
LinkPair = tuple[str, str]


class SelfCollisionChecker:
    """Distances between the links that may not touch; joint values are (n,) [rad] or [m] in the arm's order."""

    def __init__(
        self, arm: ArmDescription, model: pin.Model, configuration: JointMapping, with_rigid: bool = False
    ) -> None:
        """Links that no joint can move apart are checked `with_rigid` only: nothing can be done about them."""
        self.clearance = arm.clearance  # [m]
        self._model = model
        self._configuration = configuration
        self._geometry = load_collision_geometry(arm, model)
        self._pairs = _add_pairs(arm, model, self._geometry, with_rigid)
        self._data = model.createData()
        self._geometry_data = self._geometry.createData()
        self.reach = reach_of(arm, model, self._geometry)

    @property
    def geometry_count(self) -> int:
        """The number of collision shapes; never zero."""
        return int(self._geometry.ngeoms)

    @property
    def pairs(self) -> tuple[LinkPair, ...]:
        """The pairs of links that are checked."""
        return tuple(dict.fromkeys(self._pairs))

    def distance(self, positions: Sequence[float] | Array) -> float:
        """[m] between the nearest pair at `positions` (n,) [rad] or [m]; negative inside, infinite without pairs."""
        if not self._pairs:
            return math.inf
        self._update(positions)
        return float(min(result.min_distance for result in self._geometry_data.distanceResults))

    def distances(self, positions: Sequence[float] | Array) -> dict[LinkPair, float]:
        """[m] between the links of every pair that is checked, at `positions` (n,) [rad] or [m]."""
        if not self._pairs:
            return {}
        self._update(positions)
        nearest: dict[LinkPair, float] = {}
        for pair, result in zip(self._pairs, self._geometry_data.distanceResults, strict=True):
            nearest[pair] = min(nearest.get(pair, math.inf), float(result.min_distance))
        return nearest

    def pairs_within(self, positions: Sequence[float] | Array, margin: float = 0.0) -> list[LinkPair]:
        """The pairs of links nearer than `margin` [m], each once."""
        if not self._pairs:
            return []
        self._update(positions)
        results = self._geometry_data.distanceResults
        near = (pair for pair, result in zip(self._pairs, results, strict=True) if result.min_distance <= margin)
        return list(dict.fromkeys(near))

    def _update(self, positions: Sequence[float] | Array) -> None:
        q = self._configuration.to_pinocchio(positions)
        pin.computeDistances(self._model, self._data, self._geometry, self._geometry_data, q)


_newest: tuple[weakref.ref[ArmDescription], pin.GeometryModel] | None = None  # of the arm that was loaded last


def load_collision_geometry(arm: ArmDescription, model: pin.Model) -> pin.GeometryModel:
    """The collision shapes, read once for as long as the arm is the newest: large meshes take seconds.

    The model is the caller's own, its shapes are shared; raises `DescriptionError` where one could not be read.
    """
    global _newest
    if _newest is None or _newest[0]() is not arm:
        _newest = weakref.ref(arm), read_collision_geometry(arm, model)
    return _newest[1].copy()


def read_collision_geometry(arm: ArmDescription, model: pin.Model) -> pin.GeometryModel:
    """The collision shapes, read anew; counted, since Pinocchio drops what it does not know WITHOUT an error."""
    expected = sum(len(link.collisions) for link in arm.model.links)
    geometry = pin.buildGeomFromUrdf(
        model, str(arm.urdf_path), pin.GeometryType.COLLISION, package_dirs=[str(arm.folder)]
    )
    if expected == 0:
        fit = remedy("fit_collisions", folder=str(arm.folder))
        raise wrong_file(arm.urdf_path, because("urdf.collision.none", fit))
    if geometry.ngeoms != expected:
        what = because("urdf.collision.not_loaded", remedy("use_shapes"), loaded=geometry.ngeoms, count=expected)
        raise wrong_file(arm.urdf_path, what)
    for shape in geometry.geometryObjects:
        shape.geometry = convex_or_same(shape.geometry)
    return geometry


def _add_pairs(arm: ArmDescription, model: pin.Model, geometry: pin.GeometryModel, with_rigid: bool) -> list[LinkPair]:
    """Adds every pair of shapes on different links that is not disabled; returns the link names in the same order."""
    links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    pairs: list[LinkPair] = []
    for first in range(len(links)):
        for second in range(first + 1, len(links)):
            one, other = links[first], links[second]
            if not with_rigid and are_rigid(geometry, first, second):
                continue
            if one != other and not arm.collisions_are_disabled(one, other):
                geometry.addCollisionPair(pin.CollisionPair(first, second))
                pairs.append((one, other))
    return pairs


def are_rigid(geometry: pin.GeometryModel, first: int, second: int) -> bool:
    """True if no joint moves these two shapes against one another."""
    shapes = geometry.geometryObjects
    return bool(shapes[first].parentJoint == shapes[second].parentJoint)


def reach_of(arm: ArmDescription, model: pin.Model, geometry: pin.GeometryModel) -> Array:
    """(n,) how far at most [m] any point of any shape moves per unit of each joint: [m/rad] or [m/m].

    For a turning joint that is the longest way from its axis to the end of the chain, all travel included.
    """
    fold = np.array([_joint_reach(arm, model, geometry, joint) for joint in range(1, model.njoints)])
    reach = np.zeros(len(arm.joints))
    for index, bound in enumerate(fold, start=1):
        source, scale = driver_of(arm, model, index)
        reach[source] += scale * bound
    return reach


def driver_of(arm: ArmDescription, model: pin.Model, index: int) -> tuple[int, float]:
    """The arm's joint that drives pinocchio's joint `index`, and the ratio of their motions (through mimic joints)."""
    joint, scale = arm.model.joint(model.names[index]), 1.0
    while joint.mimic is not None:
        scale *= abs(joint.mimic.multiplier)
        joint = arm.model.joint(joint.mimic.joint)
    return arm.joint_names.index(joint.name), scale


def _joint_reach(arm: ArmDescription, model: pin.Model, geometry: pin.GeometryModel, joint: int) -> float:
    if _slides(model, joint):
        return 1.0
    moved = (shape for shape in geometry.geometryObjects if joint in model.supports[shape.parentJoint])
    return max((shape_reach(arm, model, shape, joint) for shape in moved), default=0.0)


def shape_reach(arm: ArmDescription, model: pin.Model, shape: pin.GeometryObject, joint: int) -> float:
    """An upper bound [m/rad] or [m/m] of the motion of any point of a shape per unit of pinocchio's `joint`."""
    if _slides(model, joint):
        return 1.0
    shape.geometry.computeLocalAABB()
    length = float(np.linalg.norm(shape.placement.translation)) + _radius(shape)
    link = int(shape.parentJoint)
    while link != joint:
        length += float(np.linalg.norm(model.jointPlacements[link].translation)) + _travel(arm, model, link)
        link = int(model.parents[link])
    return length


def _radius(shape: pin.GeometryObject) -> float:
    """An upper bound of the distance of a shape's points from its own origin [m]."""
    return float(np.linalg.norm(shape.geometry.aabb_center)) + float(shape.geometry.aabb_radius)


def _travel(arm: ArmDescription, model: pin.Model, joint: int) -> float:
    """The travel of a prismatic joint [m]; 0 for a revolute one."""
    if not _slides(model, joint):
        return 0.0
    limit = arm.model.joint(model.names[joint]).limit
    return 0.0 if limit is None else max(abs(limit.lower), abs(limit.upper))


def _slides(model: pin.Model, joint: int) -> bool:
    return bool(model.joints[joint].shortname().startswith("JointModelP"))
