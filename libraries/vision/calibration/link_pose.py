"""The pose of one link as a matrix, fast enough to be asked for thousands of times without pinocchio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gemelo.libraries.arm.frames.transforms import inverse, to_message
from gemelo.libraries.arm.kinematics.chain import complete, joint_transform, link_transforms
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.libraries.vision.rigid import Array, from_transform

LinkAt = Callable[[Array], Array]  # base_from_link (4, 4) at joint values (n,) [rad] or [m] in the arm's order


def link_pose(arm: ArmDescription, link: str) -> LinkAt:
    """The function from joint values to the pose of `link` in the arm's base frame."""
    above = {joint.child: joint for joint in arm.model.joints}
    chain: list[UrdfJoint] = []
    while link in above:
        chain.insert(0, above[link])
        link = above[link].parent
    base = from_transform(to_message(inverse(link_transforms(arm.model, {})[arm.base_frame])))
    parts = [(joint.name, joint.kind, *_parts(joint)) for joint in chain]
    has_mimics = any(joint.mimic is not None for joint in arm.model.joints)

    def at(values: Array) -> Array:
        known = dict(zip(arm.joint_names, values.tolist(), strict=True))
        if has_mimics:
            known = complete(arm.model, known)
        pose = base
        for name, kind, still, first, second in parts:
            position = known.get(name, 0.0)
            if kind is JointKind.FIXED:
                pose = pose @ still
            elif kind is JointKind.PRISMATIC:
                pose = pose @ (still + position * first)
            else:
                pose = pose @ (still + np.cos(position) * first + np.sin(position) * second)
        return np.asarray(pose)

    return at


def _parts(joint: UrdfJoint) -> tuple[Array, Array, Array]:
    """What of a joint's matrix stands still, and what goes with its position, or with its cosine and sine."""
    at_zero, at_one = (_matrix(joint, position) for position in (0.0, 1.0))
    if joint.kind is JointKind.FIXED:
        return at_zero, np.zeros((4, 4)), np.zeros((4, 4))
    if joint.kind is JointKind.PRISMATIC:
        return at_zero, at_one - at_zero, np.zeros((4, 4))
    quarter, half = _matrix(joint, np.pi / 2.0), _matrix(joint, np.pi)
    still = (at_zero + half) / 2.0
    return still, at_zero - still, quarter - still


def _matrix(joint: UrdfJoint, position: float) -> Array:
    return from_transform(to_message(joint_transform(joint, position)))
