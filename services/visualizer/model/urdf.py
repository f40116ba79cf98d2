"""A URDF's text as the model that is drawn."""

from __future__ import annotations

import tomllib
from xml.etree import ElementTree

import numpy as np

from gemelo.services.visualizer.model.rotations import Array, quaternion
from gemelo.services.visualizer.model.visual_model import Visual, VisualJoint, VisualModel, VisualShape


def parse_urdf(text: str) -> VisualModel:
    """The model in a URDF's text; raises ValueError with what is wrong with it."""
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"the URDF is not XML: {error}") from error
    colors = {material.get("name", ""): _color(material) for material in robot.findall("material")}
    visuals = {
        link.get("name", ""): tuple(_visual(visual, colors) for visual in link.findall("visual"))
        for link in robot.findall("link")
    }
    joints = [_joint(element) for element in robot.findall("joint")]
    children = {joint.child for joint in joints}
    roots = [link for link in visuals if link not in children]
    if len(roots) != 1:
        raise ValueError(f"the URDF has {len(roots)} root links ({', '.join(roots)}): it must have one")
    model = _tree(robot.get("name", "robot"), roots[0], joints, visuals)
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


def _joint(element: ElementTree.Element) -> VisualJoint:
    translation, rotation = _origin(element)
    axis = np.array(_numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0)))
    mimic, limit = element.find("mimic"), element.find("limit")
    kind = element.get("type", "fixed")
    lower, upper = (0.0, 0.0) if limit is None else (float(limit.get(key, "0")) for key in ("lower", "upper"))
    return VisualJoint(
        name=element.get("name", ""), kind=kind, parent=_link(element, "parent"), child=_link(element, "child"),
        translation=translation, rotation=rotation, axis=axis / (np.linalg.norm(axis) or 1.0),
        mimic=None if mimic is None else _mimic(mimic), travel=upper - lower if kind == "prismatic" else 0.0,
        middle=(lower + upper) / 2.0,
    )  # fmt: skip


def _mimic(element: ElementTree.Element) -> tuple[str, float, float]:
    return element.get("joint", ""), float(element.get("multiplier", "1")), float(element.get("offset", "0"))


def _link(element: ElementTree.Element, tag: str) -> str:
    found = element.find(tag)
    return "" if found is None else found.get("link", "")


def _visual(element: ElementTree.Element, colors: dict[str, tuple[int, int, int] | None]) -> Visual:
    translation, rotation = _origin(element)
    material = element.find("material")
    color = None if material is None else _color(material) or colors.get(material.get("name", ""))
    return Visual(_shape(element), translation, rotation, color)


def _shape(visual: ElementTree.Element) -> VisualShape:
    for element in visual.findall("geometry/*"):
        match element.tag:
            case "box":
                return VisualShape("box", _numbers(element, "size", (0.0, 0.0, 0.0)))
            case "cylinder":
                return VisualShape("cylinder", (float(element.get("radius", "0")), float(element.get("length", "0"))))
            case "sphere":
                return VisualShape("sphere", (float(element.get("radius", "0")),))
            case "mesh":
                return VisualShape("mesh", _numbers(element, "scale", (1.0, 1.0, 1.0)), element.get("filename", ""))
    return VisualShape("box", (0.0, 0.0, 0.0))


def _color(material: ElementTree.Element) -> tuple[int, int, int] | None:
    element = material.find("color")
    if element is None:
        return None
    red, green, blue = (round(255 * value) for value in _numbers(element, "rgba", (0.7, 0.7, 0.7, 1.0))[:3])
    return red, green, blue


def _origin(element: ElementTree.Element) -> tuple[Array, Array]:
    origin = element.find("origin")
    return np.array(_numbers(origin, "xyz", (0.0,) * 3)), quaternion(*_numbers(origin, "rpy", (0.0,) * 3))


def _numbers(element: ElementTree.Element | None, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
    text = None if element is None else element.get(key)
    values = default if text is None else tuple(float(word) for word in text.split())
    if len(values) != len(default):
        raise ValueError(f'{key}="{text}" must have {len(default)} numbers')
    return values


def tool_link(model: VisualModel, robot_toml: str) -> str:
    """`tool_frame` of robot.toml; the last link of the tree where the file names none that the URDF has."""
    named = str(tomllib.loads(robot_toml).get("tool_frame", ""))
    return named if named in model.paths else max(model.paths, key=lambda link: model.paths[link].count("/"))
