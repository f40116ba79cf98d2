"""The collision geometry of the arm itself, without a scene: read and computed once for one arm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics, frame_of_link
from gemelo.libraries.arm.kinematics.self_collisions import driver_of, load_collision_geometry, shape_reach
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import PlanningScene, SceneObject
from gemelo.services.planner.collision.scene_shapes import SceneError, is_read_from_a_file, shape_of
from gemelo.services.planner.collision_geometry.coal_shapes import geometry_of, mesh_of
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Tuning constants: chosen, where a line does not say measured or standard.
ENDLESS = 1e6  # [m] chosen: a half space as a box, beyond every arm, and finite for coal


class PlacedObject(NamedTuple):
    """An object of a scene, as pinocchio has it: on which joint (0: the base), the box (2, 3) around it, and its
    reach (joints,) as `ArmGeometry.reach_of`."""

    item: SceneObject
    shape: CollisionShape
    placed: pin.GeometryObject
    joint: int
    box: Array
    reach: Array


class ArmGeometry:
    """The links' shapes in the URDF's order; a joint is one of pinocchio's, mimics included, but for the universe."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics) -> None:
        self.arm, self.pinocchio, self._base = arm, kinematics.model, kinematics.base
        self.model = load_collision_geometry(arm, kinematics.model)
        shapes = list(self.model.geometryObjects)
        self.names = [kinematics.model.frames[shape.parentFrame].name for shape in shapes]
        self.joints = np.array([int(shape.parentJoint) for shape in shapes], dtype=int)
        self.meshes = [mesh_of(shape.geometry) for shape in shapes]
        self.boxes = np.array([box_of(shape.geometry) for shape in shapes])
        self.drivers = self._drivers()
        self.reach = np.array([self.reach_of(shape) for shape in shapes])
        self.checked = self._checked()
        self._shapes: dict[str, tuple[SceneObject, CollisionShape]] = {}  # of the newest scene, by name
        self._placed: dict[str, PlacedObject] = {}

    def shapes(self, scene: PlanningScene, folders: Sequence[Path]) -> tuple[CollisionShape, ...]:
        """The objects of a scene as solids; of those of the scene before it the same, but of what is read from a file.
        Raises `SceneError` for what cannot be."""
        known, newest = self._shapes, dict[str, tuple[SceneObject, CollisionShape]]()
        shapes = list[CollisionShape]()
        for item in scene.objects:
            before = known.get(item.name)
            if before is not None and (before[0] is item or before[0] == item):
                newest[item.name] = before
                shapes.append(before[1])
                continue
            self._require_link(item)
            shape = shape_of(item, folders)
            if not is_read_from_a_file(item):
                newest[item.name] = item, shape
            shapes.append(shape)
        if len({item.name for item in scene.objects}) != len(shapes):
            raise SceneError(because("scene.names.same", remedy("other_name_for_one")))
        self._shapes = newest
        return tuple(shapes)

    def placed(self, scene: PlanningScene, shapes: Sequence[CollisionShape]) -> list[PlacedObject]:
        """The objects of a scene, whose `shapes` these are; those of the scene before it are computed no second
        time."""
        known, placed = self._placed, list[PlacedObject]()
        for item, shape in zip(scene.objects, shapes, strict=True):
            before = known.get(item.name)
            is_known = before is not None and before.shape is shape and (before.item is item or before.item == item)
            placed.append(before if before is not None and is_known else self._place(item, shape))
        self._placed = {each.item.name: each for each in placed}
        return placed

    def _require_link(self, item: SceneObject) -> None:
        if item.attached and item.frame not in self.arm.model.link_names:
            named = {"object": item.name, "link": item.frame, "robot": self.arm.name}
            raise SceneError(because("scene.link.gone", **named))

    def _place(self, item: SceneObject, shape: CollisionShape) -> PlacedObject:
        inner = pin.SE3(shape.matrix[:3, :3], shape.matrix[:3, 3])
        geometry = geometry_of(shape)
        if not item.attached:
            placed = pin.GeometryObject(item.name, 0, 0, self._base.act(inner), geometry)
            return PlacedObject(item, shape, placed, 0, box_around(shape, geometry), np.zeros(len(self.drivers)))
        number = frame_of_link(self.pinocchio, item.frame)
        frame = self.pinocchio.frames[number]
        joint = int(frame.parentJoint)
        placed = pin.GeometryObject(item.name, joint, number, frame.placement.act(inner), geometry)
        return PlacedObject(item, shape, placed, joint, box_around(shape, geometry), self.reach_of(placed))

    def reach_of(self, shape: pin.GeometryObject) -> Array:
        """(joints,) [m/rad] or [m/m] that any point of the shape moves at most per unit of each joint; 0 for those that
        do not carry it."""
        reach = np.zeros(self.pinocchio.njoints - 1)
        for joint in self.pinocchio.supports[shape.parentJoint]:
            if joint > 0:
                reach[joint - 1] = shape_reach(self.arm, self.pinocchio, shape, joint)
        return reach

    def _drivers(self) -> Array:
        """(joints, n) the ratio of each joint's motion to that of the arm's joint that drives it."""
        drivers = np.zeros((self.pinocchio.njoints - 1, len(self.arm.joints)))
        for joint in range(1, self.pinocchio.njoints):
            source, scale = driver_of(self.arm, self.pinocchio, joint)
            drivers[joint - 1, source] = scale
        return drivers

    def _checked(self) -> Mask:
        """(shapes, shapes) True for pairs on links that a joint moves apart and that the SRDF does not allow to
        touch."""
        allowed = np.array(
            [[one == two or self.arm.collisions_are_disabled(one, two) for two in self.names] for one in self.names]
        )
        return np.asarray(~allowed & (self.joints[:, None] != self.joints[None, :]))


_KNOWN: WeakKeyDictionary[Kinematics, ArmGeometry] = WeakKeyDictionary()


def arm_geometry(arm: ArmDescription, kinematics: Kinematics) -> ArmGeometry:
    """The geometry of `arm`; built once for as long as its kinematics are in use."""
    known = _KNOWN.get(kinematics)
    if known is None or known.arm is not arm:
        known = _KNOWN[kinematics] = ArmGeometry(arm, kinematics)
    return known


def box_around(shape: CollisionShape, geometry: coal.CollisionGeometry) -> Array:
    """(2, 3) as `box_of` the `geometry` of `shape`: of a plain solid by its sizes, in an eighth of the time."""
    match shape.kind, shape.size:
        case ShapeKind.BOX, (x, y, z):
            half = (0.5 * x, 0.5 * y, 0.5 * z)
        case ShapeKind.CYLINDER, (radius, length):
            half = (radius, radius, 0.5 * length)
        case ShapeKind.SPHERE, (radius,):
            half = (radius, radius, radius)
        case _:
            return box_of(geometry)
    geometry.computeLocalAABB()  # coal knows its centre and radius only from then on
    return np.array(((0.0, 0.0, 0.0), half))


def box_of(geometry: coal.CollisionGeometry) -> Array:
    """(2, 3) centre and half sizes [m] of a box around the shape in its own frame."""
    if isinstance(geometry, coal.Halfspace):
        return np.array([[0.0, 0.0, -ENDLESS], [np.inf, np.inf, ENDLESS]])
    geometry.computeLocalAABB()
    low, high = geometry.aabb_local.min_, geometry.aabb_local.max_
    return np.array([0.5 * (low + high), 0.5 * (high - low)])
