"""A URDF's text as the model that is drawn."""

from __future__ import annotations

import tomllib

import numpy as np

from gemelo.libraries.arm.model.urdf import SIZES, Geometry, JointKind, Origin, UrdfJoint, urdf_of
from gemelo.libraries.arm.model.xml_reader import joined
from gemelo.services.visualizer.model.rotations import Array, quaternion
from gemelo.services.visualizer.model.visual_model import Visual, VisualJoint, VisualModel, VisualShape

NOTHING = VisualShape("box", (0.0, 0.0, 0.0))  # of a shape that URDF does not have


def parse_urdf(text: str) -> VisualModel:
    """The model in a URDF's text; raises ValueError with what is wrong with it."""
    robot, faults = urdf_of(text)
    if faults:
        raise ValueError(joined(faults))
    visuals = {link.name: tuple(map(_visual, link.visuals)) for link in robot.links}
    joints = [_joint(joint) for joint in robot.joints]
    children = {joint.child for joint in joints}
    roots = [link for link in visuals if link not in children]
    if len(roots) != 1:
        raise ValueError(f"the URDF has {len(roots)} root links ({', '.join(roots)}): it must have one")
    model = _tree(robot.name or "robot", roots[0], joints, visuals)
    _require_leaders(model)
    return model


def _require_leaders(model: VisualModel) -> None:
    names = {joint.name for joint in model.moving}
    for joint in model.joints:
        if joint.mimic is not None and joint.mimic[0] not in names:
            raise ValueError(f"joint {joint.name} mimics {joint.mimic[0]}, which does not move by itself")


def _tree(name: str, root: str, joints: list[VisualJoint], visuals: dict[str, tuple[Visual, ...]]) -> VisualModel:
    ordered: list[VisualJoint] = []
    paths = {root: root}
    links = [root]
    while links:
        link = links.pop(0)
        for joint in joints:
            if joint.parent == link:
                if joint.child in paths:
                    raise ValueError(f"link {joint.child} hangs on two joints: the URDF is not a tree")
                ordered.append(joint)
                paths[joint.child] = f"{paths[link]}/{joint.child}"
                links.append(joint.child)
    return VisualModel(name, root, tuple(ordered), visuals, paths)


def _joint(joint: UrdfJoint) -> VisualJoint:
    translation, rotation = _placed(joint.origin)
    lower, upper = (0.0, 0.0) if joint.limit is None else (joint.limit.lower, joint.limit.upper)
    mimic = joint.mimic
    return VisualJoint(
        name=joint.name, kind=joint.kind, parent=joint.parent, child=joint.child,
        translation=translation, rotation=rotation, axis=np.array(joint.axis),
        mimic=None if mimic is None else (mimic.joint, mimic.multiplier, mimic.offset),
        travel=upper - lower if joint.kind is JointKind.PRISMATIC else 0.0, middle=(lower + upper) / 2.0,
    )  # fmt: skip


def _visual(geometry: Geometry) -> Visual:
    return Visual(_shape(geometry), *_placed(geometry.origin), geometry.color)


def _shape(geometry: Geometry) -> VisualShape:
    if geometry.mesh is not None:
        return VisualShape("mesh", geometry.scale, geometry.mesh)
    return VisualShape(geometry.shape, geometry.size) if geometry.shape in SIZES else NOTHING


def _placed(origin: Origin) -> tuple[Array, Array]:
    return np.array(origin.xyz), quaternion(*origin.rpy)


def tool_link(model: VisualModel, robot_toml: str) -> str:
    """`tool_frame` of robot.toml; the last link of the tree where the file names none that the URDF has."""
    named = str(tomllib.loads(robot_toml).get("tool_frame", ""))
    return named if named in model.paths else max(model.paths, key=lambda link: model.paths[link].count("/"))
