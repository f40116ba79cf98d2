"""A URDF as plain records: a light reader by ElementTree, held against yourdfpy and pinocchio by the tests."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from gemelo.libraries.arm.errors import DescriptionError, Subject, nearest_name, wrong_file
from gemelo.libraries.arm.model.robot_file import read_text
from gemelo.libraries.arm.model.xml_reader import Triple as Triple
from gemelo.libraries.arm.model.xml_reader import XmlFault, XmlReader, joined, parse_xml
from gemelo.schemas.reasons import because, remedy

Color = tuple[int, int, int]  # red, green and blue, 0 to 255
Colors = dict[str, Color | None]  # by the name of their <material>

ZERO: Triple = (0.0, 0.0, 0.0)
DEFAULT_AXIS: Triple = (1.0, 0.0, 0.0)
NO_SHAPE = "nothing"  # of a geometry that cannot be read
SIZES = {"box": {"size": 3}, "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}}  # how many numbers
SINGLE = {  # what an element has once at the most, by its tag: a reader takes the first and is silent about another
    "link": ("inertial",),
    "joint": ("origin", "parent", "child", "axis", "limit", "mimic"),
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin", "geometry"),
    "collision": ("origin", "geometry"),
}


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
    line: int = field(default=0, compare=False)  # of the file


@dataclass(frozen=True)
class Inertial:
    """Mass [kg] and inertia (ixx, ixy, ixz, iyy, iyz, izz) [kg m^2] about `origin`."""

    mass: float
    inertia: tuple[float, float, float, float, float, float]
    origin: Origin


@dataclass(frozen=True)
class Geometry:
    """A shape: its tag ("box", "cylinder", "sphere", "mesh", ...) and, for a mesh, its reference as written.

    `origin` is in the link; `scale` is of a mesh, in m for each of its units; `size` of the others, as URDF names it.
    """

    shape: str
    mesh: str | None = None
    origin: Origin = Origin()
    scale: Triple = (1.0, 1.0, 1.0)
    size: tuple[float, ...] = ()  # [m] x, y, z; radius; or radius and length
    color: Color | None = field(default=None, compare=False)  # None: the reader's own
    line: int = field(default=0, compare=False)  # of the file


@dataclass(frozen=True)
class UrdfLink:
    """One link."""

    name: str
    inertial: Inertial | None
    visuals: tuple[Geometry, ...]
    collisions: tuple[Geometry, ...]
    line: int = field(default=0, compare=False)  # of the file


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
    """The URDF in `path`; raises `DescriptionError` naming the file and every element that is wrong."""
    model, faults = survey_urdf(path)
    if faults:
        raise wrong_file(path, joined(faults))
    return model


def survey_urdf(path: Path) -> tuple[UrdfModel, list[XmlFault]]:
    """What can be read of the URDF in `path`, and every fault; raises `DescriptionError` where it is no URDF."""
    try:
        return urdf_of(read_text(path))
    except DescriptionError as error:
        raise error if str(path) in error.reason.values.values() else wrong_file(path, error.reason) from error


def urdf_of(text: str) -> tuple[UrdfModel, list[XmlFault]]:
    """What can be read of a URDF's text, and every fault; raises `DescriptionError` where it is no URDF."""
    return model_of(parse_xml(text))


def model_of(xml: XmlReader) -> tuple[UrdfModel, list[XmlFault]]:
    """As `urdf_of`, of elements that are parsed."""
    if xml.root.tag != "robot":
        raise DescriptionError(because("urdf.root", tag=xml.root.tag))
    colors = {material.get("name", ""): _color(material) for material in xml.root.findall("material")}
    links = tuple(_link(xml, element, colors) for element in xml.root.findall("link"))
    joints = tuple(_joint(xml, element) for element in xml.root.findall("joint"))
    _require_single(xml)
    return UrdfModel(xml.root.get("name", ""), links, joints), xml.faults


def _require_single(xml: XmlReader) -> None:
    """Faults of what would be passed over: a second, other element, and a link or a joint within another one."""
    for outer in (each for each in xml.root if each.tag in ("link", "joint")):
        where = Subject(outer.tag, outer.get("name", ""))
        for element in outer.iter():
            for tag in SINGLE.get(element.tag, ()):
                several = element.findall(tag)
                if len({ET.tostring(each).strip() for each in several}) > 1:
                    for each in several:
                        what = because("urdf.element.several", remedy("leave_one"), tag=tag, count=len(several))
                        xml.fault(each, where, what)
            if element is not outer and element.tag in ("link", "joint"):
                inner = Subject(element.tag, element.get("name", ""))
                what = because("urdf.element.within", remedy("move_behind"), kind=where.kind, name=where.name)
                xml.fault(element, inner, what)


def _link(xml: XmlReader, element: ET.Element, colors: Colors) -> UrdfLink:
    name = xml.text(element, "name", Subject("<link>"))
    where, inertial = Subject("link", name), element.find("inertial")
    return UrdfLink(
        name=name,
        inertial=None if inertial is None else _inertial(xml, inertial, where),
        visuals=tuple(
            replace(_geometry(xml, item, where), color=_color_of(item, colors)) for item in element.findall("visual")
        ),
        collisions=tuple(_geometry(xml, item, where) for item in element.findall("collision")),
        line=xml.lines.get(element, 0),
    )


def _joint(xml: XmlReader, element: ET.Element) -> UrdfJoint:
    name = xml.text(element, "name", Subject("<joint>"))
    where = Subject("joint", name)
    kind = _kind(xml, element, where)
    return UrdfJoint(
        name=name,
        kind=kind,
        parent=xml.text(xml.child(element, "parent", where), "link", where),
        child=xml.text(xml.child(element, "child", where), "link", where),
        origin=_origin(xml, element, where),
        axis=_axis(xml, element.find("axis"), kind, where),
        limit=_limit(xml, element.find("limit"), where),
        mimic=_mimic(xml, element.find("mimic"), where),
        line=xml.lines.get(element, 0),
    )


def _kind(xml: XmlReader, element: ET.Element, where: Subject) -> JointKind:
    """Fixed, where it is none that is known."""
    kind = element.get("type", "")
    if kind in set(JointKind):
        return JointKind(kind)
    near = nearest_name(kind.lower(), JointKind) or JointKind.REVOLUTE
    free = kind in ("floating", "planar")
    mend = remedy("fix_or_split") if free else remedy("write_line", text=f'type="{near}"')
    xml.fault(element, where, because("urdf.joint.type", mend, type=kind, known=tuple(map(str, JointKind))))
    return JointKind.FIXED


def _axis(xml: XmlReader, element: ET.Element | None, kind: JointKind, where: Subject) -> Triple:
    """Of length one; a fixed joint's has no meaning, and exporters write zero there."""
    if element is None or kind is JointKind.FIXED:
        return DEFAULT_AXIS
    axis = xml.triple(element, "xyz", DEFAULT_AXIS, where)
    length = math.sqrt(sum(value * value for value in axis))
    if length < 1e-9:
        xml.fault(element, where, because("urdf.axis.zero", remedy("write_axis")))
        return DEFAULT_AXIS
    return axis[0] / length, axis[1] / length, axis[2] / length


def _limit(xml: XmlReader, element: ET.Element | None, where: Subject) -> Limit | None:
    if element is None:
        return None
    return Limit(*(xml.number(element, key, where, 0.0) for key in ("lower", "upper", "effort", "velocity")))


def _mimic(xml: XmlReader, element: ET.Element | None, where: Subject) -> Mimic | None:
    if element is None:
        return None
    joint = xml.text(element, "joint", where._replace(part="<mimic>"))
    return Mimic(joint, xml.number(element, "multiplier", where, 1.0), xml.number(element, "offset", where, 0.0))


def _inertial(xml: XmlReader, element: ET.Element, where: Subject) -> Inertial:
    mass = xml.number(xml.child(element, "mass", where), "value", where)
    tensor = xml.child(element, "inertia", where)
    ixx, ixy, ixz, iyy, iyz, izz = (xml.number(tensor, k, where) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return Inertial(mass, (ixx, ixy, ixz, iyy, iyz, izz), _origin(xml, element, where))


def _geometry(xml: XmlReader, element: ET.Element, where: Subject) -> Geometry:
    geometry, line = xml.child(element, "geometry", where._replace(part=f"<{element.tag}>")), xml.lines.get(element, 0)
    if len(geometry) != 1:
        if xml.lines.get(geometry):
            mend = remedy("own_element", tag=element.tag) if len(geometry) else remedy("add_a_box")
            xml.fault(element, where, because("urdf.geometry.shapes", mend, count=len(geometry)))
        return Geometry(NO_SHAPE, line=line)
    shape, origin = geometry[0], _origin(xml, element, where)
    if shape.tag == "mesh":
        scale = xml.triple(shape, "scale", (1.0, 1.0, 1.0), where._replace(part="<mesh>"))
        return Geometry("mesh", xml.text(shape, "filename", where._replace(part="<mesh>")), origin, scale, line=line)
    return Geometry(shape.tag, origin=origin, size=_sizes(xml, shape, where), line=line)


def _sizes(xml: XmlReader, shape: ET.Element, where: Subject) -> tuple[float, ...]:
    """[m] of a box, a cylinder or a ball, as far as they can be read."""
    sizes: list[float] = []
    for name, count in SIZES.get(shape.tag, {}).items():
        text = xml.text(shape, name, where._replace(part=f"<{shape.tag}>"))
        if _are_sizes(text.split(), count):
            sizes += map(float, text.split())
        elif text:
            size = {"attribute": name, "tag": shape.tag, "text": text}
            mend = remedy("leave_out_or_correct")
            if count == 1:
                xml.fault(shape, where, because("urdf.size.one", mend, **size))
            else:
                xml.fault(shape, where, because("urdf.size.several", mend, **size, count=count))
    return tuple(sizes)


def _are_sizes(words: list[str], count: int) -> bool:
    try:
        return len(words) == count and all(0.0 < float(word) < math.inf for word in words)
    except ValueError:
        return False


def _origin(xml: XmlReader, element: ET.Element, where: Subject) -> Origin:
    origin = element.find("origin")
    return Origin(xml.triple(origin, "xyz", ZERO, where), xml.triple(origin, "rpy", ZERO, where))


def _color_of(visual: ET.Element, colors: Colors) -> Color | None:
    """Of the <material> within it, or of the robot's own that it names."""
    material = visual.find("material")
    return None if material is None else _color(material) or colors.get(material.get("name", ""))


def _color(material: ET.Element) -> Color | None:
    """None without a <color> of four numbers: a colour is no reason to refuse an arm."""
    element = material.find("color")
    try:
        red, green, blue, _ = map(float, ("" if element is None else element.get("rgba", "")).split())
        return round(255 * red), round(255 * green), round(255 * blue)
    except (ValueError, OverflowError):
        return None
