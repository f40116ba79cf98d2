"""rm1 between two walls that it cannot turn past: a search that ends only where it must."""

from __future__ import annotations

import math

from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FreeMotion, JointGoal, PlanRequest
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject

NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")


def wall(name: str, angle: float) -> SceneObject:
    """From the column outwards."""
    pose = Transform(
        translation=(0.55 * math.cos(angle), 0.55 * math.sin(angle), 0.0),
        rotation=(0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
    )
    return SceneObject(name=name, shape=BoxShape(size=(0.9, 0.02, 3.0)), pose=pose)


WALLED = PlanningScene(version=8, objects=(wall("left wall", 0.6), wall("right wall", -1.6)))


def past_the_wall(request_id: str = "", planner_id: str = "", allowed: float = 100.0) -> PlanRequest:
    """There is no way."""
    return PlanRequest(
        start=JointState(name=NAMES, position=(0.0, 0.3, 0.05)),
        goal=JointGoal(name=NAMES, position=(1.2, 0.3, 0.05)),
        motion=FreeMotion(planner_id=planner_id),
        allowed_time=allowed,
        request_id=request_id,
    )
