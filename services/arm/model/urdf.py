"""A URDF as plain records: a light reader by ElementTree, held against yourdfpy and pinocchio by the tests."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from services.arm.errors import DescriptionError
from services.arm.model.robot_file import read_text

Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)


class JointKind(StrEnum):
    """The joint types of URDF that this project moves or fixes."""

    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"
    FIXED = "fixed"


@dataclass(frozen=True)
class Origin:
    """Position (3,) [m] and roll, pitch, yaw (3,) [rad] about fixed axes."""

    xyz: Triple = ZERO
    rpy: Triple = ZERO


@dataclass(frozen=True)
class Limit:
    """The limits of a joint in the URDF: [rad] or [m], per second; effort in [N m] or [N]."""

    lower: float
    upper: float
    effort: float
    velocity: float


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: multiplier * that + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class UrdfJoint:
    """One joint: `origin` of the child frame in the parent's, `axis` in the child's."""

    name: str
    kind: JointKind
    parent: str
    child: str
    origin: Origin
    axis: Triple
    limit: Limit | None
    mimic: Mimic | None


@dataclass(frozen=True)
class Inertial:
    """Mass [kg] and inertia (ixx, ixy, ixz, iyy, iyz, izz) [kg m^2] about `origin`."""

    mass: float
    inertia: tuple[float, float, float, float, float, float]
    origin: Origin


@dataclass(frozen=True)
class Geometry:
    """A shape: its tag ("box", "cylinder", "sphere", "mesh", ...) and, for a mesh, its reference as written.

    `origin` is in the link; `scale` is of a mesh, in m for each of its units.
    """

    shape: str
    mesh: str | None = None
    origin: Origin = Origin()
    scale: Triple = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class UrdfLink:
    """One link."""

    name: str
    inertial: Inertial | None
    visuals: tuple[Geometry, ...]
    collisions: tuple[Geometry, ...]


@dataclass(frozen=True)
class UrdfModel:
    """A whole URDF, in the order of the file."""

    name: str
    links: tuple[UrdfLink, ...]
    joints: tuple[UrdfJoint, ...]

    def joint(self, name: str) -> UrdfJoint:
        """The joint of that name; KeyError where there is none."""
        return next_named(name, self.joints)

    @property
    def link_names(self) -> tuple[str, ...]:
        return tuple(link.name for link in self.links)

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)


def next_named(name: str, joints: tuple[UrdfJoint, ...]) -> UrdfJoint:
    """The first joint of that name; KeyError where there is none."""
    for joint in joints:
        if joint.name == name:
            return joint
    raise KeyError(name)


def read_urdf(path: Path) -> UrdfModel:
    """The URDF in `path`; raises `DescriptionError` naming the file and the element."""
    text = read_text(path)
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise DescriptionError(f"{path}: not XML: {error}") from error
    if root.tag != "robot":
        raise DescriptionError(f"{path}: the root element is <{root.tag}>, it must be <robot>")
    try:
        links = tuple(_link(element) for element in root.findall("link"))
        joints = tuple(_joint(element) for element in root.findall("joint"))
    except DescriptionError as error:
        raise DescriptionError(f"{path}: {error}") from error
    return UrdfModel(root.get("name", ""), links, joints)


def _link(element: ET.Element) -> UrdfLink:
    name = _attribute(element, "name", "a <link>")
    inertial = element.find("inertial")
    return UrdfLink(
        name=name,
        inertial=None if inertial is None else _inertial(inertial, f'link "{name}"'),
        visuals=tuple(_geometry(item, f'link "{name}"') for item in element.findall("visual")),
        collisions=tuple(_geometry(item, f'link "{name}"') for item in element.findall("collision")),
    )


def _joint(element: ET.Element) -> UrdfJoint:
    name = _attribute(element, "name", "a <joint>")
    where = f'joint "{name}"'
    kind = element.get("type", "")
    if kind not in set(JointKind):
        raise DescriptionError(f'{where}: type "{kind}" is not one of {", ".join(JointKind)}')
    return UrdfJoint(
        name=name,
        kind=JointKind(kind),
        parent=_attribute(_child(element, "parent", where), "link", where),
        child=_attribute(_child(element, "child", where), "link", where),
        origin=_origin(element, where),
        axis=_axis(element.find("axis"), kind, where),
        limit=_limit(element.find("limit"), where),
        mimic=_mimic(element.find("mimic"), where),
    )


def _axis(element: ET.Element | None, kind: str, where: str) -> Triple:
    """Of length one; a fixed joint's has no meaning, and exporters write zero there."""
    if element is None or kind == JointKind.FIXED:
        return (1.0, 0.0, 0.0)
    return _unit(_triple(element.get("xyz", "1 0 0"), where), where)


def _limit(element: ET.Element | None, where: str) -> Limit | None:
    if element is None:
        return None
    return Limit(*(_number(element, key, where, 0.0) for key in ("lower", "upper", "effort", "velocity")))


def _mimic(element: ET.Element | None, where: str) -> Mimic | None:
    if element is None:
        return None
    joint = _attribute(element, "joint", f"{where}, <mimic>")
    return Mimic(joint, _number(element, "multiplier", where, 1.0), _number(element, "offset", where, 0.0))


def _inertial(element: ET.Element, where: str) -> Inertial:
    mass = _number(_child(element, "mass", where), "value", where)
    tensor = _child(element, "inertia", where)
    ixx, ixy, ixz, iyy, iyz, izz = (_number(tensor, k, where) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return Inertial(mass, (ixx, ixy, ixz, iyy, iyz, izz), _origin(element, where))


def _geometry(element: ET.Element, where: str) -> Geometry:
    geometry = _child(element, "geometry", f"{where}, <{element.tag}>")
    if len(geometry) != 1:
        raise DescriptionError(f"{where}: a <geometry> has {len(geometry)} shapes, it must have one")
    shape = geometry[0]
    origin = _origin(element, where)
    if shape.tag == "mesh":
        scale = _triple(shape.get("scale", "1 1 1"), f"{where}, <mesh>")
        return Geometry("mesh", _attribute(shape, "filename", f"{where}, <mesh>"), origin, scale)
    return Geometry(shape.tag, origin=origin)


def _origin(element: ET.Element, where: str) -> Origin:
    origin = element.find("origin")
    if origin is None:
        return Origin()
    return Origin(_triple(origin.get("xyz", "0 0 0"), where), _triple(origin.get("rpy", "0 0 0"), where))


def _child(element: ET.Element, tag: str, where: str) -> ET.Element:
    found = element.find(tag)
    if found is None:
        raise DescriptionError(f"{where}: <{tag}> is missing")
    return found


def _attribute(element: ET.Element, name: str, where: str) -> str:
    value = element.get(name)
    if not value:
        raise DescriptionError(f"{where}: attribute `{name}` of <{element.tag}> is missing")
    return value


def _number(element: ET.Element, name: str, where: str, default: float | None = None) -> float:
    text = element.get(name)
    if text is None:
        if default is None:
            raise DescriptionError(f"{where}: attribute `{name}` of <{element.tag}> is missing")
        return default
    return _finite(text, f"{where}: `{name}` of <{element.tag}>")


def _triple(text: str, where: str) -> Triple:
    numbers = [_finite(word, where) for word in text.split()]
    if len(numbers) != 3:
        raise DescriptionError(f'{where}: "{text}" must be three numbers')
    return numbers[0], numbers[1], numbers[2]


def _finite(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise DescriptionError(f'{where}: "{text}" is not a number') from error
    if not math.isfinite(value):
        raise DescriptionError(f"{where}: {text} is not finite")
    return value


def _unit(axis: Triple, where: str) -> Triple:
    length = math.sqrt(sum(value * value for value in axis))
    if length < 1e-9:
        raise DescriptionError(f"{where}: the axis is zero")
    return axis[0] / length, axis[1] / length, axis[2] / length
