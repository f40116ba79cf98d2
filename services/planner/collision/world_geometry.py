"""The shapes of the arm, of what it carries and of what stands around it, and which pairs of them are checked."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.schemas.reasons import because
from gemelo.schemas.scene import AllowedPair, PlanningScene
from gemelo.services.planner.collision.arm_geometry import ArmGeometry, Mask
from gemelo.services.planner.collision.scene_shapes import ANY, SceneError
from gemelo.services.planner.collision_geometry.shapes import CollisionShape

Array = NDArray[np.float64]
# Tuning constants: chosen, where a line does not say measured or standard.
FEW = 100  # pairs: coal is done with them before numpy has said which of them matter


class WorldGeometry:
    """Built once for one state of the scene; one entry a shape, links first, and one a pair that is checked."""

    def __init__(self, own: ArmGeometry, scene: PlanningScene, shapes: Sequence[CollisionShape]) -> None:
        """`shapes` are those of the objects of the `scene`, in its order."""
        self._scene = scene
        self._own, self._links = own, len(own.names)
        self.model = own.model.copy()
        self.shape_names = [*own.names, *(item.name for item in scene.objects)]
        objects = own.placed(scene, shapes)
        for each in objects:
            self.model.addGeometryObject(each.placed)
        self._require_all(len(self.shape_names))
        self.meshes = [*own.meshes, *(each.shape.mesh for each in objects)]
        joints = np.array([*own.joints, *(each.joint for each in objects)], dtype=int)
        self.moving: list[int] = np.flatnonzero(joints).tolist()
        both, self.direct = self._checked(joints)
        self.both: NDArray[np.int_] = both  # (k, 2) numbers of the shapes
        self.pairs: list[tuple[int, int]] = list(zip(*both.T.tolist(), strict=True))
        paddings = np.array([0.0] * self._links + [each.shape.padding for each in objects])
        self.padding: list[float] = paddings[both].sum(axis=1).tolist()
        self.boxes = np.array([*own.boxes, *(each.box for each in objects)])
        per_shape = np.array([*own.reach, *(each.reach for each in objects)])
        self.reach: Array = per_shape.max(axis=0, initial=0.0) @ own.drivers
        self.pair_reach: Array = _between(per_shape, both) @ own.drivers

    @cached_property
    def names(self) -> list[LinkPair]:
        """Of `pairs`; made when first asked for, as most plans never do."""
        names = self.shape_names
        return [(names[one], names[other]) for one, other in self.pairs]

    def _require_all(self, expected: int) -> None:
        """A shape that silently is not there would make everything look free."""
        if self.model.ngeoms != expected:
            raise SceneError(because("scene.shapes.missing", count=int(self.model.ngeoms), needed=expected))

    def _checked(self, joints: NDArray[np.int_]) -> tuple[NDArray[np.int_], int]:
        """The pairs (k, 2) that a joint can move apart and that nothing allows to touch: links among themselves, then
        objects, then all with a mesh.

        The first of them, as many as the second result says, are known to the model as well and worth looking at in
        every configuration: there are few.
        """
        links = self._links
        mask = joints[:, None] != joints[None, :]
        mask[:links, :links] = self._own.checked
        mask &= ~self._allowed()
        both = np.argwhere(np.triu(mask, 1))
        is_mesh = np.array([mesh is not None for mesh in self.meshes])
        has_object = both[:, 1] >= links
        kind = np.where(is_mesh[both].any(axis=1), 2, has_object)
        both = both[np.argsort(kind, kind="stable")]
        count = np.cumsum(np.bincount(kind, minlength=3))
        direct = max((int(some) for some in count[:2] if some <= FEW), default=0)
        for one, other in both[:direct].tolist():
            self.model.addCollisionPair(pin.CollisionPair(one, other))
        return both, direct

    def _allowed(self) -> Mask:
        """(shapes, shapes) True for pairs that the scene allows to touch, or an attached object's touch links do; an
        attached object is no part of its link for the SRDF."""
        names, links = np.array(self.shape_names, dtype=object), self._links
        allowed = np.zeros((len(names), len(names)), dtype=bool)
        for pair in self._scene.allowed:
            allowed |= _either(pair, names)
        for index, item in enumerate(self._scene.objects, start=links):
            if item.attached:
                touched = np.isin(names, (item.frame, *item.touch_links))
                allowed[index] |= touched
                allowed[:, index] |= touched
        return allowed


def _either(pair: AllowedPair, names: NDArray[np.object_]) -> Mask:
    """(shapes, shapes) True where the pair names both, in either order."""
    first, second = (np.full(len(names), name == ANY) | (names == name) for name in (pair.first, pair.second))
    both = np.outer(first, second)
    return np.asarray(both | both.T)


def _between(reach: Array, both: NDArray[np.int_]) -> Array:
    """(k, joints) how far at most [m] the two shapes of each pair (k, 2) move against one another per unit of each
    joint, from the reach of each shape (shapes, joints); joints that carry both do not count."""
    one, other = reach[both[:, 0]], reach[both[:, 1]]
    return np.where((one > 0.0) != (other > 0.0), one + other, 0.0)


class LowerBounds:
    """From the ball around one shape to the box around the other, and the other way round; of `pairs` alone."""

    def __init__(self, geometry: WorldGeometry) -> None:
        self._moving = geometry.moving
        self.pairs = range(geometry.direct, len(geometry.pairs))
        self._padding = np.array(geometry.padding[geometry.direct :])
        self._first, self._second = geometry.both[geometry.direct :].T
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
