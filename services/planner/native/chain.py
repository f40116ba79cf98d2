"""An arm's joints as the native planner wants them: a frame for each moving joint with the joint's axis as its z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import wrong_file
from gemelo.libraries.arm.kinematics.chain import origin_of
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.schemas.reasons import because
from gemelo.services.planner.collision_geometry.shapes import matrix_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ChainFrames:
    """Rows for `_motion.chain`, and every link's frame with the link's pose (4, 4) in it; frame 0 is the base."""

    links: NDArray[np.int32]  # (f, 3): parent, drive, slides
    numbers: Array  # (f, 15): transform, multiplier, offset, travel
    places: dict[str, tuple[int, Array]]


def frames_of(arm: ArmDescription) -> ChainFrames:
    """The arm's tree, without its fixed joints."""
    root = _root(arm)
    links, numbers = [(0, 0, 0)], [_row(np.eye(4), 1.0, 0.0, 0.0)]
    places: dict[str, tuple[int, Array]] = {root: (0, inverse_of(_base_in_root(arm, root)))}
    for joint in _from_root(arm, root):
        frame, pose = places[joint.parent]
        here = pose @ matrix_of(origin_of(joint))
        if joint.kind is JointKind.FIXED:
            places[joint.child] = (frame, here)
            continue
        turn = _to_axis(np.array(joint.axis))
        drive, multiplier, offset = _drive(arm, joint)
        links.append((frame, drive, int(joint.kind is JointKind.PRISMATIC)))
        numbers.append(_row(here @ turn, multiplier, offset, _travel(arm, joint, drive, multiplier, offset)))
        places[joint.child] = (len(links) - 1, turn.T)
    return ChainFrames(np.array(links, dtype=np.int32), np.array(numbers), places)


def inverse_of(matrix: Array) -> Array:
    """The inverse (4, 4) of a rigid transform (4, 4), translation in its own unit."""
    inverse = np.eye(4)
    inverse[:3, :3] = matrix[:3, :3].T
    inverse[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return inverse


def transform_row(matrix: Array) -> Array:
    """The rotation by rows, then the translation, (12,), of a rigid transform (4, 4)."""
    return np.concatenate((matrix[:3, :3].reshape(9), matrix[:3, 3]))


def _row(matrix: Array, multiplier: float, offset: float, travel: float) -> Array:
    return np.concatenate((transform_row(matrix), (multiplier, offset, travel)))


def _root(arm: ArmDescription) -> str:
    children = {joint.child for joint in arm.model.joints}
    return next(name for name in arm.model.link_names if name not in children)


def _base_in_root(arm: ArmDescription, root: str) -> Array:
    """(4, 4) of the base frame, which no joint moves."""
    pose, link = np.eye(4), arm.base_frame
    while link != root:
        joint = next(joint for joint in arm.model.joints if joint.child == link)
        if joint.kind is not JointKind.FIXED:
            raise wrong_file(arm.robot_path, because("robot.base_frame.moves", frame=arm.base_frame))
        pose = matrix_of(origin_of(joint)) @ pose
        link = joint.parent
    return pose


def _from_root(arm: ArmDescription, root: str) -> list[UrdfJoint]:
    """All joints, parents before children."""
    ordered: list[UrdfJoint] = []
    waiting = [root]
    while waiting:
        link = waiting.pop(0)
        below = [joint for joint in arm.model.joints if joint.parent == link]
        ordered += below
        waiting += [joint.child for joint in below]
    return ordered


def _to_axis(axis: Array) -> Array:
    """(4, 4): a rotation whose z is `axis`."""
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(aside, axis) / np.linalg.norm(np.cross(aside, axis))
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack((x, np.cross(axis, x), axis))
    return matrix


def _drive(arm: ArmDescription, joint: UrdfJoint) -> tuple[int, float, float]:
    """Which joint value moves it, times what, plus what: through chains of mimics."""
    multiplier, offset = 1.0, 0.0
    for _ in arm.model.joints:
        if joint.mimic is None:
            return arm.joint_names.index(joint.name), multiplier, offset
        offset += multiplier * joint.mimic.offset
        multiplier *= joint.mimic.multiplier
        joint = arm.model.joint(joint.mimic.joint)
    raise wrong_file(arm.urdf_path, because("robot.joint.mimics_itself", joint=joint.name))


def _travel(arm: ArmDescription, joint: UrdfJoint, drive: int, multiplier: float, offset: float) -> float:
    """[m] a sliding joint can be away from 0; 0 for a turning one."""
    if joint.kind is not JointKind.PRISMATIC:
        return 0.0
    driver = arm.joints[drive]
    return abs(multiplier) * max(abs(driver.lower), abs(driver.upper)) + abs(offset)
