"""Collision checks of the arm with itself, its load and its surroundings: coal on the exact shapes.

The reference of every faster check, with the names that `SelfCollisionChecker` has for the arm alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.scene import Contact, PlanningScene
from gemelo.services.planner.collision.arm_geometry import arm_geometry
from gemelo.services.planner.collision.continuous import ContinuousCheck
from gemelo.services.planner.collision.pair_distances import PairDistances
from gemelo.services.planner.collision.world_geometry import LowerBounds, WorldGeometry
from gemelo.services.planner.collision_geometry.coal_shapes import is_inside
from gemelo.services.planner.request.deadline import NEVER, Deadline

Array = NDArray[np.float64]
# Tuning constants: chosen, where a line does not say measured or standard.
MOST_CONTACTS = 500  # that are told of one configuration; chosen: a person reads ten, and they fit into a message
MANY = 2000  # triangles; chosen: one distance then takes as long as a thousand others
Positions = Sequence[float] | Array


class Side(NamedTuple):
    """A point (3,) in a mesh's frame, how far [m] its shape was from the surface, and on which side of it."""

    point: Array
    distance: float
    is_inside: bool


class World:
    """One arm in one state of the scene, never changed; joint values are (n,) [rad] or [m] in the arm's order."""

    def __init__(
        self,
        arm: ArmDescription,
        kinematics: Kinematics,
        scene: PlanningScene | None = None,
        folders: Sequence[Path] = (),
    ) -> None:
        """Mesh files are looked for in `folders`; raises `SceneError` for a scene that cannot be.

        What coal needs is made when it is first asked, as most plans never do, but with meshes at once: these may
        take a second.
        """
        self.arm = arm
        self.scene, self.folders = scene or PlanningScene(), tuple(folders)
        self._kinematics = kinematics
        self._own = arm_geometry(arm, kinematics)
        self.shapes = self._own.shapes(self.scene, folders)  # of the objects, in their order
        self._deadline = NEVER
        self._sides: dict[tuple[int, int], Side] = {}  # the shapes' numbers, outer first
        if any(shape.mesh is not None for shape in self.shapes):
            _ = self.geometry

    @cached_property
    def geometry(self) -> WorldGeometry:
        """What is checked against what, on the exact shapes."""
        return WorldGeometry(self._own, self.scene, self.shapes)

    @cached_property
    def _bounds(self) -> LowerBounds:
        return LowerBounds(self.geometry)

    @cached_property
    def _data(self) -> pin.Data:
        return self._kinematics.model.createData()

    @cached_property
    def _placed(self) -> pin.GeometryData:
        return self.geometry.model.createData()

    @cached_property
    def _distances(self) -> PairDistances:
        distances = PairDistances(self.geometry)
        distances.deadline = self._deadline
        return distances

    @cached_property
    def _sweep(self) -> ContinuousCheck:
        return ContinuousCheck(self.geometry.pair_reach, self.distances)

    @property
    def reach(self) -> Array:
        """(n,) [m/rad] or [m/m] that any point of the arm moves at most per unit of each joint."""
        return self.geometry.reach

    @property
    def clearance(self) -> float:
        """[m] that is to stay free between things that may not touch: the robot's own."""
        return self.arm.clearance

    @property
    def deadline(self) -> Deadline:
        """Of the plan that asks: once it has passed, questions that may take long raise `PlanRefused`."""
        return self._deadline

    @deadline.setter
    def deadline(self, deadline: Deadline) -> None:
        self._deadline = deadline
        if "_distances" in vars(self):
            self._distances.deadline = deadline

    @property
    def version(self) -> int:
        """Of the scene."""
        return self.scene.version

    @property
    def objects(self) -> dict[str, str]:
        """What each object of the scene is: "box", "sphere", ... by name."""
        return {item.name: str(item.shape.__struct_config__.tag) for item in self.scene.objects}

    @property
    def geometry_count(self) -> int:
        """How many shapes there are, of links and of objects; never zero."""
        return int(self.geometry.model.ngeoms)

    @property
    def pairs(self) -> tuple[LinkPair, ...]:
        """The names of links and objects that are checked against one another."""
        return tuple(dict.fromkeys(self.geometry.names))

    def distance(self, positions: Positions, padding: float = 0.0) -> float:
        """[m] between the nearest pair that is checked, less `padding`; negative inside, infinite where nothing is."""
        self._place(positions)
        nearest = min((distance for _, distance in self._direct()), default=math.inf)
        bounds = self._bounds.of(self._placed)
        for place in np.argsort(bounds).tolist():
            if bounds[place] >= nearest:
                break
            nearest = min(nearest, self._exact(self._bounds.pairs[place]))
        return nearest - padding

    def distances(self, positions: Positions, numbers: Sequence[int]) -> Array:
        """(k,) [m] between the shapes of these pairs alone; a number is the place in `pair_names`."""
        q = self._kinematics.configuration.to_pinocchio(positions)
        pin.updateGeometryPlacements(self._kinematics.model, self._data, self.geometry.model, self._placed, q)
        return np.array([self._exact(index) for index in numbers])

    def least_distances(self, positions: Positions) -> Array:
        """(pairs,) [m] that each pair is apart at least, cheaply; minus infinity where that says nothing."""
        q = self._kinematics.configuration.to_pinocchio(positions)
        pin.updateGeometryPlacements(self._kinematics.model, self._data, self.geometry.model, self._placed, q)
        bounds = self._bounds.of(self._placed)
        return np.concatenate((np.full(len(self.geometry.pairs) - len(bounds), -np.inf), bounds))

    @property
    def is_dear(self) -> NDArray[np.bool_]:
        """(pairs,) True for each pair of shapes whose meshes have more than `MANY` triangles together: one distance
        takes as long as a thousand others."""
        sizes = [0 if mesh is None else len(mesh.faces) for mesh in self.geometry.meshes]
        return np.array([sizes[one] + sizes[other] > MANY for one, other in self.geometry.pairs], dtype=bool)

    @property
    def pair_names(self) -> Sequence[LinkPair]:
        """Of every pair of shapes; a link may have several shapes."""
        return self.geometry.names

    @property
    def pair_reach(self) -> Array:
        """(pairs, n) how far at most [m] two shapes move against one another per unit of each joint."""
        return self._sweep.reach

    def touching(self, positions: Array, margin: float, pairs: frozenset[LinkPair] | None = None) -> Array | None:
        """Any configuration along the rows of `positions` (m, n) at which something is nearer than `margin` [m], or
        None; of the `pairs` of these names alone, in either order, where they are given."""
        return self._sweep.touching(positions, margin, self.deadline, None if pairs is None else self._numbers(pairs))

    def _numbers(self, pairs: frozenset[LinkPair]) -> NDArray[np.int_]:
        """(k,) the places in `pair_names` of all shapes of the pairs of these names."""
        numbers = (self._by_name.get(pair, []) + self._by_name.get((pair[1], pair[0]), []) for pair in pairs)
        return np.array(sorted(chain.from_iterable(numbers)), dtype=int)

    @cached_property
    def _by_name(self) -> dict[LinkPair, list[int]]:
        places: dict[LinkPair, list[int]] = {}
        for place, pair in enumerate(self.geometry.names):
            places.setdefault(pair, []).append(place)
        return places

    def pairs_within(self, positions: Positions, margin: float = 0.0) -> list[LinkPair]:
        """The pairs of names nearer than `margin` [m], each once."""
        near = (self.geometry.names[index] for index, _ in self._near(positions, margin))
        return list(dict.fromkeys(near))

    def contacts(self, positions: Positions, margin: float = 0.0) -> list[Contact]:
        """The pairs nearer than `margin` [m] with their distance and the point between them, the nearest first, and
        `MOST_CONTACTS` at most."""
        found: dict[LinkPair, Contact] = {}
        for index, distance in sorted(self._near(positions, margin), key=lambda near: near[1]):
            pair = self.geometry.names[index]
            point = self._point_between(index)
            found.setdefault(pair, Contact(first=pair[0], second=pair[1], distance=distance, point=point))
            if len(found) == MOST_CONTACTS:
                break
        return list(found.values())

    def _place(self, positions: Positions) -> None:
        """Moves the shapes, and computes the distances of the pairs that are looked at in every configuration."""
        q = self._kinematics.configuration.to_pinocchio(positions)
        pin.updateGeometryPlacements(self._kinematics.model, self._data, self.geometry.model, self._placed, q)
        pin.computeDistances(self.geometry.model, self._placed)

    def _direct(self) -> Iterator[tuple[int, float]]:
        """Number and distance [m] of the pairs that `_place` has looked at."""
        results = self._placed.distanceResults
        for index, padding in enumerate(self.geometry.padding[: self.geometry.direct]):
            yield index, results[index].min_distance - padding

    def _near(self, positions: Positions, margin: float) -> Iterator[tuple[int, float]]:
        """Number and distance [m] of the pairs nearer than `margin`."""
        self._place(positions)
        yield from (near for near in self._direct() if near[1] <= margin)
        for place in np.flatnonzero(self._bounds.of(self._placed) <= margin).tolist():
            index = self._bounds.pairs[place]
            distance = self._exact(index)
            if distance <= margin:
                yield index, distance

    def _exact(self, index: int) -> float:
        """[m] between the two shapes of a pair, less their padding."""
        distance = float(self._distances.of(self._placed, index).min_distance)
        if distance > 0.0 and self._is_swallowed(index, distance):
            distance = -distance
        return distance - self.geometry.padding[index]

    def _is_swallowed(self, index: int, distance: float) -> bool:
        """True if one shape is wholly inside the other, a mesh: coal sees only its surface, `distance` [m] away."""
        one, other = self.geometry.pairs[index]
        return self._holds(one, other, distance) or self._holds(other, one, distance)

    def _holds(self, outer: int, inner: int, distance: float) -> bool:
        """No point that moves less than the surface was and is away from it has changed sides."""
        mesh = self.geometry.meshes[outer]
        if mesh is None or not np.isfinite(self.geometry.boxes[inner]).all():
            return False
        filling = self.geometry.meshes[inner]
        point = self.geometry.boxes[inner][0] if filling is None else filling.vertices[0]
        there = self._placed.oMg[outer].actInv(self._placed.oMg[inner].act(point))
        known = self._sides.get((outer, inner))
        if known is None or float(np.linalg.norm(there - known.point)) >= distance + known.distance:
            known = Side(there, distance, is_inside(mesh, there))
        self._sides[outer, inner] = Side(there, distance, known.is_inside)
        return known.is_inside

    def _point_between(self, index: int) -> tuple[float, ...]:
        """(3,) [m] in the base frame, of the distance that was computed last for this pair."""
        result = self._distances.newest(self._placed, index)
        middle = 0.5 * (result.getNearestPoint1() + result.getNearestPoint2())
        return tuple(self._kinematics.base.actInv(middle).tolist())
