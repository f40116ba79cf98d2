"""A shape that was fitted to points, and the one or three that a URDF has for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from gemelo.libraries.arm.frames.transforms import compose, from_rpy
from gemelo.libraries.arm.model.urdf import Origin, Triple
from gemelo.services.planner.collision_geometry.link_shapes import hull_mesh
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind


class FittedKind(StrEnum):
    """And what `Fitted.size` means for each, in m; along z."""

    BOX = "box"  # x, y, z: whole lengths of the edges
    SPHERE = "sphere"  # radius
    CYLINDER = "cylinder"  # radius, length
    CAPSULE = "capsule"  # radius, length of the straight part
    PLATE = "plate with round ends"  # radius of the ends, distance of their middles along x, thickness
    HULL = "convex hull"  # its volume in m^3


@dataclass(frozen=True)
class Fitted:
    """What holds all its points."""

    kind: FittedKind
    size: tuple[float, ...]
    origin: Origin  # in the link
    corners: tuple[Triple, ...] = ()  # [m] of a hull, from its origin

    @property
    def volume(self) -> float:
        """[m^3]."""
        match self.kind, self.size:
            case FittedKind.BOX, (x, y, z):
                return x * y * z
            case FittedKind.CYLINDER, (radius, length):
                return math.pi * radius**2 * length
            case FittedKind.CAPSULE, (radius, length):
                return math.pi * radius**2 * (length + 4.0 / 3.0 * radius)
            case FittedKind.PLATE, (radius, length, thickness):
                return (math.pi * radius + 2.0 * length) * radius * thickness
            case FittedKind.HULL, (volume,):
                return volume
        return 4.0 / 3.0 * math.pi * self.size[0] ** 3

    @property
    def shapes(self) -> tuple[CollisionShape, ...]:
        """It in the link's frame, as what a URDF knows: a capsule and a plate are three."""
        return self._shapes

    @cached_property
    def _shapes(self) -> tuple[CollisionShape, ...]:
        match self.kind, self.size:
            case FittedKind.CAPSULE, (radius, length):
                balls = (self._shape(ShapeKind.SPHERE, (radius,), (0.0, 0.0, side * length)) for side in (-0.5, 0.5))
                return self._shape(ShapeKind.CYLINDER, (radius, length)), *balls
            case FittedKind.PLATE, (radius, length, thickness):
                ends = (
                    self._shape(ShapeKind.CYLINDER, (radius, thickness), (side * length, 0.0, 0.0))
                    for side in (-0.5, 0.5)
                )
                return self._shape(ShapeKind.BOX, (length, 2.0 * radius, thickness)), *ends
            case FittedKind.HULL, _:
                pose = (self.origin.xyz, from_rpy(*self.origin.rpy))
                return (CollisionShape("hull", ShapeKind.HULL, (), pose, hull_mesh(np.array(self.corners))),)
        return (self._shape(ShapeKind(self.kind), self.size),)

    def _shape(self, kind: ShapeKind, size: tuple[float, ...], at: Triple = (0.0, 0.0, 0.0)) -> CollisionShape:
        turn = from_rpy(*self.origin.rpy)
        return CollisionShape(str(kind), kind, size, compose((self.origin.xyz, turn), (at, (0.0, 0.0, 0.0, 1.0))))
