"""The shapes of the arm, of what it carries and of what stands around it, and which pairs of them are checked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from schemas.scene import PlanningScene, SceneObject
from services.arm.kinematics.kinematics import Kinematics
from services.arm.kinematics.self_collisions import LinkPair, load_collision_geometry, reach_of
from services.arm.model.description import Arm
from services.planner.collision.scene_shapes import SceneError, allows, shape_of
from services.planner.collision_geometry.coal_shapes import geometry_of, mesh_of
from services.planner.collision_geometry.shapes import CollisionShape, matrix_of

Array = NDArray[np.float64]
# Tuning constants: chosen, where a line does not say measured or standard.
ENDLESS = 1e6  # [m]
FEW = 100  # pairs of solids: coal is done with them before numpy has said which of them matter


class WorldGeometry:
    """Built once for one state of the scene; one entry a shape, links first, and one a pair that is checked."""

    def __init__(self, arm: Arm, kinematics: Kinematics, scene: PlanningScene, folders: Sequence[Path]) -> None:
        self._arm, self._kinematics, self._scene = arm, kinematics, scene
        self.model = load_collision_geometry(arm, kinematics.model)
        links = [kinematics.model.frames[shape.parentFrame].name for shape in self.model.geometryObjects]
        self.shape_names = [*links, *(item.name for item in scene.objects)]
        self.meshes = [mesh_of(shape.geometry) for shape in self.model.geometryObjects]
        paddings = [0.0] * len(links)
        for item in scene.objects:
            shape = shape_of(item, folders)
            self.model.addGeometryObject(self._placed(item, shape))
            self.meshes.append(shape.mesh)
            paddings.append(shape.padding)
        self._require_all(len(links) + len(scene.objects))
        self._links = len(links)
        self._joints = [int(shape.parentJoint) for shape in self.model.geometryObjects]
        self.pairs, self.direct = self._checked()
        self.names: list[LinkPair] = [(self.shape_names[one], self.shape_names[other]) for one, other in self.pairs]
        self.padding = [paddings[one] + paddings[other] for one, other in self.pairs]
        self.boxes = np.array([_box(shape.geometry) for shape in self.model.geometryObjects])
        self.moving = [index for index, joint in enumerate(self._joints) if joint != 0]
        self.reach: Array = reach_of(arm, kinematics.model, self.model)

    def _placed(self, item: SceneObject, shape: CollisionShape) -> pin.GeometryObject:
        pose = matrix_of(shape.pose)
        inner = pin.SE3(pose[:3, :3], pose[:3, 3])
        if not item.attached:
            return pin.GeometryObject(item.name, 0, 0, self._kinematics.base.act(inner), geometry_of(shape))
        model = self._kinematics.model
        if item.frame not in self._arm.model.link_names:
            raise SceneError(
                f'object "{item.name}" is attached to "{item.frame}", which {self._arm.name} does not have'
            )
        number = model.getFrameId(item.frame)
        frame = model.frames[number]
        placement = frame.placement.act(inner)
        return pin.GeometryObject(item.name, int(frame.parentJoint), number, placement, geometry_of(shape))

    def _require_all(self, expected: int) -> None:
        """A shape that silently is not there would make everything look free."""
        if self.model.ngeoms != expected:
            raise SceneError(f"the checker has {self.model.ngeoms} of {expected} shapes; are two objects of one name?")

    def _checked(self) -> tuple[list[tuple[int, int]], int]:
        """The pairs that a joint can move apart and that nothing allows to touch, known to the model as well.

        The first of them, as many as the second result says, are worth looking at in every configuration: links among
        themselves, and solids while there are few.
        """
        count = len(self.shape_names)
        pairs = [
            (one, other) for one in range(count) for other in range(one + 1, count) if self._is_checked(one, other)
        ]
        own = [pair for pair in pairs if pair[1] < self._links]
        others = [pair for pair in pairs if pair[1] >= self._links]
        meshes = [(one, other) for one, other in others if self.meshes[one] or self.meshes[other]]
        solids = [(one, other) for one, other in others if not (self.meshes[one] or self.meshes[other])]
        for one, other in own + solids + meshes:
            self.model.addCollisionPair(pin.CollisionPair(one, other))
        return own + solids + meshes, len(own) + (len(solids) if len(solids) <= FEW else 0)

    def _is_checked(self, one: int, other: int) -> bool:
        """Two links as the SRDF has it; an attached object is no part of its link for the SRDF."""
        first, second = self.shape_names[one], self.shape_names[other]
        links = self._links
        if self._joints[one] == self._joints[other]:
            return False
        if allows(self._scene.allowed, first, second):
            return False
        if other < links:
            return first != second and not self._arm.collisions_are_disabled(first, second)
        return second not in self._touched(one) and first not in self._touched(other)

    def _touched(self, index: int) -> tuple[str, ...]:
        if index < self._links:
            return ()
        item = self._scene.objects[index - self._links]
        return (item.frame, *item.touch_links) if item.attached else ()


def _box(geometry: coal.CollisionGeometry) -> Array:
    """(2, 3) centre and half sizes [m] of a box around the shape in its own frame."""
    if isinstance(geometry, coal.Halfspace):
        return np.array([[0.0, 0.0, -ENDLESS], [np.inf, np.inf, ENDLESS]])
    geometry.computeLocalAABB()
    low, high = geometry.aabb_local.min_, geometry.aabb_local.max_
    return np.array([0.5 * (low + high), 0.5 * (high - low)])


class LowerBounds:
    """From the ball around one shape to the box around the other, and the other way round; of `pairs` alone."""

    def __init__(self, geometry: WorldGeometry) -> None:
        self._moving = geometry.moving
        self.pairs = range(geometry.direct, len(geometry.pairs))
        self._padding = np.array(geometry.padding[geometry.direct :])
        both = np.array(geometry.pairs[geometry.direct :], dtype=int).reshape(-1, 2)
        self._first, self._second = both.T
        self._centres, self._halves = geometry.boxes[:, 0], geometry.boxes[:, 1]
        self._radii = np.linalg.norm(self._halves, axis=1)
        placements = [shape.placement for shape in geometry.model.geometryObjects]
        self._rotations = np.array([placement.rotation for placement in placements])
        self._origins = np.array([placement.translation for placement in placements])

    def of(self, placed: pin.GeometryData) -> Array:
        """(k,) [m] for each of `pairs`, less its padding, where the shapes are now."""
        if not self.pairs:
            return self._padding
        for index in self._moving:
            placement = placed.oMg[index]
            self._rotations[index], self._origins[index] = placement.rotation, placement.translation
        balls = self._origins + np.einsum("gij,gj->gi", self._rotations, self._centres)
        both = np.maximum(
            self._gaps(balls, self._first, self._second),
            self._gaps(balls, self._second, self._first),
        )
        bounds: Array = np.where(both > 0.0, both, -np.inf)  # a box says nothing of how deep two shapes are in
        less: Array = bounds - self._padding
        return less

    def _gaps(self, balls: Array, ball: NDArray[np.int_], box: NDArray[np.int_]) -> Array:
        """(k,) [m] from the ball around the one to the box around the other; negative where they overlap."""
        inside = np.einsum("kji,kj->ki", self._rotations[box], balls[ball] - self._origins[box])
        outside = np.maximum(np.abs(inside - self._centres[box]) - self._halves[box], 0.0)
        return np.asarray(np.linalg.norm(outside, axis=1) - self._radii[ball])
