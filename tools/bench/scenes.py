"""The arms, scenes and configurations on which planning, kinematics and collision checks are measured."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Vector
from gemelo.schemas.scene import BoxShape, CylinderShape, PlanningScene, SceneObject

Array = NDArray[np.float64]

BARS = 10  # of the cage
SEED = 3  # of the random configurations


def rm1() -> ArmDescription:
    """The arm of `urdf/rm1`: three joints."""
    return load_arm(project_root() / "urdf/rm1")


def parol6() -> ArmDescription:
    """The arm of `urdf/parol6`: six joints."""
    return load_arm(project_root() / "urdf/parol6")


def random_configurations(arm: ArmDescription, count: int) -> Array:
    """(count, n) joint values [rad] or [m] within the limits, one turn if unlimited; the same ones in every run."""
    lower = [joint.lower if math.isfinite(joint.lower) else -math.pi for joint in arm.joints]
    upper = [joint.upper if math.isfinite(joint.upper) else math.pi for joint in arm.joints]
    return np.random.default_rng(SEED).uniform(lower, upper, (count, len(arm.joints)))


def box(name: str, size: Vector, place: Vector) -> SceneObject:
    """A box with edges `size` [m] centred at `place` [m] in the base frame."""
    return SceneObject(name=name, shape=BoxShape(size=size), pose=Transform(translation=place))


def bar(index: int) -> SceneObject:
    """One of the cage's upright bars, 2 cm thick, on a circle of radius 0.38 m around the arm."""
    angle = 0.3 + math.tau * index / BARS
    place = (0.38 * math.cos(angle), 0.38 * math.sin(angle), 0.3)
    return SceneObject(
        name=f"bar {index}", shape=CylinderShape(radius=0.01, length=0.6), pose=Transform(translation=place)
    )


TABLE = box("table", (1.2, 1.2, 0.02), (0.0, 0.0, -0.02))
CRATE = box("crate", (0.08, 0.08, 0.15), (0.25, 0.10, 0.075))
BLOCK = box("block", (0.06, 0.20, 0.20), (-0.20, 0.20, 0.10))
# For arms that reach about half a metre.
SCENES = {
    "empty": PlanningScene(version=1),
    "table + boxes": PlanningScene(version=2, objects=(TABLE, CRATE, BLOCK)),
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
# For single collision checks and jogging.
CHECK_SCENE = PlanningScene(objects=(TABLE, CRATE, BLOCK, box("shelf", (0.20, 0.50, 0.02), (0.36, 0.0, 0.40))))
