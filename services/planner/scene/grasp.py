"""The object between the jaws of the gripper, which move along y of the tool frame, beyond it in z."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import Rigid, compose, from_message, inverse, rotate
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import jaw_edges
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import PlaneShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.scene_shapes import Folders, SceneError, pose_of, shape_of
from gemelo.services.planner.collision_geometry.coal_shapes import geometry_of
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind

Array = NDArray[np.float64]
# Tuning constants: chosen, where a line does not say measured or standard.
TOUCH = 0.001  # [m] from the space between the jaws that counts as in it


class Grasp(NamedTuple):
    """An object between the jaws."""

    item: SceneObject
    width: float  # [m] along the way of the jaws


def find_grasp(
    arm: ArmDescription, scene: PlanningScene, links: Mapping[str, Transform] | None, folders: Folders
) -> Grasp | None:
    """The object between the open jaws whose middle is nearest to theirs; None if there is none that fits.

    `links`: poses in the base. Raises `SceneError` without a gripper, or where it is not known where the arm is.
    """
    if arm.gripper is None:
        raise SceneError(because("scene.grip.no_gripper", remedy("write_gripper"), robot=arm.name))
    if links is None:
        raise SceneError(because("scene.grip.arm_unknown", remedy("start_gateway")))
    along, _, beyond = jaw_edges(arm.gripper)
    space = coal.Box(along, arm.gripper.open, beyond)
    middle = np.array([0.0, 0.0, beyond / 2.0])
    to_tool = inverse(from_message(links[arm.tool_frame]))
    found: list[tuple[float, Grasp]] = []
    for item in scene.objects:
        if item.attached or isinstance(item.shape, PlaneShape):
            continue
        pose = compose(to_tool, pose_of(item))
        shape = shape_of(item, folders)
        width = width_of(shape, pose)
        if width <= arm.gripper.open and _distance(space, middle, shape, pose) <= TOUCH:
            found.append((float(np.linalg.norm(np.array(pose[0]) - middle)), Grasp(item, width)))
    return min(found, key=lambda each: each[0])[1] if found else None


def width_of(shape: CollisionShape, pose: Rigid) -> float:
    """[m] of the solid along y of the frame that `pose` is in."""
    turn = _rotation(pose)[1]
    match shape.kind:
        case ShapeKind.BOX:
            return float(np.abs(turn) @ np.array(shape.size))
        case ShapeKind.SPHERE:
            return 2.0 * shape.size[0]
        case ShapeKind.MESH | ShapeKind.HULL:
            assert shape.mesh is not None
            return float(np.ptp(shape.mesh.vertices @ turn))
        case _:
            radius, length = shape.size[0], shape.size[1]
            upright = abs(float(turn[2]))
            return length * upright + 2.0 * radius * float(np.sqrt(max(0.0, 1.0 - upright * upright)))


def _rotation(pose: Rigid) -> Array:
    """(3, 3) the turn of the pose."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return np.array([rotate(pose[1], axis) for axis in axes]).T


def _distance(space: coal.Box, middle: Array, shape: CollisionShape, pose: Rigid) -> float:
    """[m] between the space and the solid; negative where the solid is in it."""
    of_space, of_shape = coal.Transform3s(), coal.Transform3s()
    of_space.setTranslation(middle)
    of_shape.setTranslation(np.array(pose[0]))
    of_shape.setRotation(_rotation(pose))
    result = coal.DistanceResult()
    return float(coal.distance(space, of_space, geometry_of(shape), of_shape, coal.DistanceRequest(), result))
