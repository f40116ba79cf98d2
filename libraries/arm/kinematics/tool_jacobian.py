"""The tool's position and the Jacobian of it in plain Python, for processes without pinocchio."""

from __future__ import annotations

from collections.abc import Sequence

from gemelo.libraries.arm.frames.transforms import Point, Rigid, compose, inverse, rotate
from gemelo.libraries.arm.kinematics.chain import complete, joint_transform, link_transforms, origin_of
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint


class ToolJacobian:
    """Of one arm; joint values are (n,) [rad] or [m] in the arm's order, points [m] in its base frame."""

    def __init__(self, arm: ArmDescription) -> None:
        self._names = arm.joint_names
        self._model = arm.model
        self._chain = _chain(arm)
        self._origins = [origin_of(joint) for joint in self._chain]
        self._has_mimics = any(joint.mimic for joint in arm.model.joints)
        self._base = inverse(link_transforms(arm.model, {})[arm.base_frame])
        self._drivers = [_driver(arm, joint) for joint in self._chain]  # of each: index of the motor, and its factor

    def tool(self, positions: Sequence[float]) -> Point:
        """The tool's position [m] at the joint positions [rad] or [m]."""
        return self._frames(positions)[-1][0]

    def columns(self, positions: Sequence[float]) -> tuple[Point, ...]:
        """The tool's velocity [m/s] for 1 rad/s or 1 m/s of each joint: (n, 3)."""
        *frames, tool = self._frames(positions)
        columns = [[0.0, 0.0, 0.0] for _ in self._names]
        for joint, frame, (index, factor) in zip(self._chain, frames, self._drivers, strict=True):
            if index < 0:
                continue
            axis = rotate(frame[1], joint.axis)
            moved = axis if joint.kind is JointKind.PRISMATIC else _cross(axis, _minus(tool[0], frame[0]))
            for k in range(3):
                columns[index][k] += factor * moved[k]
        return tuple((x, y, z) for x, y, z in columns)

    def _frames(self, positions: Sequence[float]) -> list[Rigid]:
        """Of every joint of the chain, at its position, and the tool's."""
        known = dict(zip(self._names, positions, strict=True))
        if self._has_mimics:
            known = complete(self._model, known)
        pose, frames = self._base, []
        for joint, origin in zip(self._chain, self._origins, strict=True):
            pose = compose(pose, joint_transform(joint, known.get(joint.name, 0.0), origin))
            frames.append(pose)
        return [*frames, pose]


def _chain(arm: ArmDescription) -> list[UrdfJoint]:
    """The joints from the root to the tool."""
    above = {joint.child: joint for joint in arm.model.joints}
    chain, link = [], arm.tool_frame
    while link in above:
        chain.append(above[link])
        link = above[link].parent
    return chain[::-1]


def _driver(arm: ArmDescription, joint: UrdfJoint) -> tuple[int, float]:
    """The motor that moves the joint, and how far for one unit of it; -1 for a fixed one."""
    factor = 1.0
    while joint.mimic is not None:
        factor *= joint.mimic.multiplier
        joint = arm.model.joint(joint.mimic.joint)
    return (arm.joint_names.index(joint.name), factor) if joint.name in arm.joint_names else (-1, 0.0)


def _minus(first: Point, second: Point) -> Point:
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]


def _cross(first: Point, second: Point) -> Point:
    a, b, c = first
    x, y, z = second
    return b * z - c * y, c * x - a * z, a * y - b * x
