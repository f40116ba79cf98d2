"""The scenes that plans are measured in, for arms that reach about half a metre."""

from __future__ import annotations

import math

from schemas.frames import Transform
from schemas.message import Vector
from schemas.scene import BoxShape, CylinderShape, PlanningScene, SceneObject

BARS = 10


def box(name: str, size: Vector, place: Vector) -> SceneObject:
    return SceneObject(name=name, shape=BoxShape(size=size), pose=Transform(translation=place))


def bar(index: int) -> SceneObject:
    """One of the cage's upright bars, 2 cm thick."""
    angle = 0.3 + math.tau * index / BARS
    place = (0.38 * math.cos(angle), 0.38 * math.sin(angle), 0.3)
    return SceneObject(
        name=f"bar {index}", shape=CylinderShape(radius=0.01, length=0.6), pose=Transform(translation=place)
    )


TABLE = box("table", (1.2, 1.2, 0.02), (0.0, 0.0, -0.02))
SCENES = {
    "empty": PlanningScene(version=1),
    "table + boxes": PlanningScene(
        version=2,
        objects=(
            TABLE,
            box("crate", (0.08, 0.08, 0.15), (0.25, 0.10, 0.075)),
            box("block", (0.06, 0.20, 0.20), (-0.20, 0.20, 0.10)),
        ),
    ),
    "shelf": PlanningScene(
        version=3,
        objects=(
            box("back", (0.02, 0.5, 0.5), (0.45, 0.0, 0.3)),
            box("lower", (0.2, 0.5, 0.02), (0.36, 0.0, 0.1)),
            box("upper", (0.2, 0.5, 0.02), (0.36, 0.0, 0.3)),
            box("left", (0.2, 0.02, 0.5), (0.36, 0.25, 0.3)),
            box("right", (0.2, 0.02, 0.5), (0.36, -0.25, 0.3)),
        ),
    ),
    "cage": PlanningScene(version=4, objects=tuple(bar(index) for index in range(BARS))),
}
