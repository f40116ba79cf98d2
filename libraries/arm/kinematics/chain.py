"""Forward kinematics of single joints and whole chains in plain Python, without pinocchio."""

from __future__ import annotations

from collections.abc import Mapping

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_axis_angle, from_rpy
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint, UrdfModel


def origin_of(joint: UrdfJoint) -> Rigid:
    """The joint's frame in its parent at position zero: translation [m] and unit quaternion."""
    return joint.origin.xyz, from_rpy(*joint.origin.rpy)


def joint_transform(joint: UrdfJoint, position: float, origin: Rigid | None = None) -> Rigid:
    """The child's pose in the parent's frame at `position` [rad] or [m]; `origin` saves computing it again."""
    placed = origin_of(joint) if origin is None else origin
    x, y, z = joint.axis
    match joint.kind:
        case JointKind.FIXED:
            return placed
        case JointKind.PRISMATIC:
            return compose(placed, ((x * position, y * position, z * position), IDENTITY[1]))
        case _:
            return compose(placed, (IDENTITY[0], from_axis_angle(joint.axis, position)))


def complete(model: UrdfModel, positions: Mapping[str, float]) -> dict[str, float]:
    """`positions` [rad] or [m] and those of the mimic joints that follow from them, chains of mimics included."""
    known = dict(positions)
    waiting = [joint for joint in model.joints if joint.mimic is not None]
    while waiting:
        ready = [joint for joint in waiting if joint.mimic and joint.mimic.joint in known]
        if not ready:
            break
        for joint in ready:
            if joint.mimic is not None:
                known[joint.name] = joint.mimic.multiplier * known[joint.mimic.joint] + joint.mimic.offset
        waiting = [joint for joint in waiting if joint not in ready]
    return known


def link_transforms(model: UrdfModel, positions: Mapping[str, float]) -> dict[str, Rigid]:
    """Every link's pose in the root link ([m], quaternion) at `positions` [rad] or [m]; absent joints are at zero."""
    known = complete(model, positions)
    children = {joint.child for joint in model.joints}
    poses = {name: IDENTITY for name in model.link_names if name not in children}
    waiting = list(model.joints)
    while waiting:
        later = []
        for joint in waiting:
            if joint.parent in poses:
                local = joint_transform(joint, known.get(joint.name, 0.0))
                poses[joint.child] = compose(poses[joint.parent], local)
            else:
                later.append(joint)
        if len(later) == len(waiting):
            break
        waiting = later
    return poses
