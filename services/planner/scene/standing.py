"""The arm's present configuration by a joint state, and the version of a scene. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import JAWS
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import SceneVersion
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.request.start_state import STALE_AFTER


def standing(arm: ArmDescription, state: JointState | None, age: float) -> Vector | None:
    """[rad] or [m] of every joint, or None without a fresh joint state of all joints; `age` [s] is of `state`."""
    if state is None or age > STALE_AFTER:
        return None
    values = dict(zip(state.name, state.position, strict=False))
    if any(name not in values for name in arm.joint_names):
        return None
    return tuple(values[name] for name in arm.joint_names)


def link_poses(kinematics: Kinematics, configuration: Vector | None) -> Mapping[str, Transform] | None:
    """Where the links are in the base, or None where that is not known."""
    return None if configuration is None else kinematics.link_poses(configuration)


def version_of(scene: PlanningScene) -> SceneVersion:
    """Which scene this is, jaws included."""
    jaws = tuple(each for each in scene.objects if each.name in JAWS)
    return SceneVersion(version=scene.version, epoch=scene.epoch, jaws=jaws)
