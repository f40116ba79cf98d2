"""Repair of a source: all problems at once; what has one answer is repaired in the elements, and said."""

from __future__ import annotations

import math
import re
import unicodedata
import xml.etree.ElementTree as ET

from gemelo.libraries.arm.errors import DescriptionError, Subject, wrong_file
from gemelo.libraries.arm.model.urdf import JointKind, model_of
from gemelo.libraries.arm.model.xml_reader import XmlReader, parse_xml
from gemelo.libraries.robot_import import link_mending, mesh_places, motion_limits, unit_mending
from gemelo.libraries.robot_import.joint_mending import fix_free_base, fix_locked, follow_the_motor
from gemelo.libraries.robot_import.mended import LEFT_OUT, Mended, numbers_in, subject_of
from gemelo.libraries.robot_import.mesh_units import mesh_units
from gemelo.libraries.robot_import.moveit_limits import joint_limits
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import RobotSource
from gemelo.libraries.robot_import.stick_figure import sticks
from gemelo.schemas.reasons import because, remedy

FOREIGN = ("gazebo", "transmission", "ros2_control", "sensor")
MOVES = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)

ROUNDED_AXIS = 0.002  # chosen: of a length that differs from 1 by less, the digits were rounded


def mend(source: RobotSource, questions: Questions | None = None) -> Mended:
    """The source, mended, as `questions` say where there is no one answer; raises `DescriptionError` where it is no
    URDF at all."""
    try:
        xml = parse_xml(source.text)
        model_of(xml)
    except DescriptionError as said:
        raise wrong_file(source.urdf, said.reason) from said
    _require_links(xml, source)
    xml.faults.clear()
    mended = Mended(source, xml, {}, questions=questions or Questions({}, takes_defaults=True))
    for step in (
        _foreign,
        _prefixed,
        _names,
        unit_mending.minuses,
        unit_mending.separators,
        unit_mending.capitals,
        link_mending.references,
        link_mending.unreadable,
        _free_base,
        _endless,
        unit_mending.degrees,
        unit_mending.lengths,
        _axes,
        motion_limits.soft_limits,
        motion_limits.calibrations,
        _mimics,
        fix_locked,
        mesh_units,
        link_mending.flat,
        link_mending.tiny,
        link_mending.frames,
        link_mending.inertias,
        mesh_places.mesh_places,
        mesh_places.collisions_beside,
        mesh_places.masses_away,
        link_mending.own_collisions,
        link_mending.unseen,
        joint_limits,
        sticks,
    ):
        step(mended)
    return mended


def _require_links(xml: XmlReader, source: RobotSource) -> None:
    """Raises `DescriptionError` for a robot without any link, as of a xacro file of macros that others call."""
    if xml.root.find("link") is None:
        code = "import.source.macros_alone" if source.is_expanded else "import.source.no_link"
        raise wrong_file(source.urdf, because(code))


def safe_name(text: str, known: set[str], allowed: str = r"[^A-Za-z0-9_.-]+") -> str:
    """ "Brazo nº 1" as Brazo_n_1: ASCII, and no other of `known`, to which it is added."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    stem = re.sub(allowed, "_", plain).strip("_") or "part"
    name, number = stem, 2
    while name in known:
        name, number = f"{stem}_{number}", number + 1
    known.add(name)
    return name


def _foreign(mended: Mended) -> None:
    """What is neither kinematics nor shape: elements of simulators and drivers, and pictures on surfaces."""
    root = mended.xml.root
    for tag in FOREIGN:
        elements = root.findall(tag)
        for element in elements:
            root.remove(element)
        if elements:
            mended.say(elements[0], Subject(f"<{tag}>"), because("mend.unused", LEFT_OUT, count=len(elements)))
    for material in root.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
            picture = because("mend.texture", LEFT_OUT, file=texture.get("filename", ""))
            mended.say(texture, Subject("<texture>"), picture)
    _colours(mended)


def _prefixed(mended: Mended) -> None:
    """Elements and attributes of another program's namespace, over which readers stumble where it is not declared."""
    found: dict[str, list[ET.Element]] = {}
    for parent in list(mended.xml.root.iter()):
        for element in [each for each in parent if ":" in each.tag]:
            parent.remove(element)
            found.setdefault(element.tag, []).append(element)
        for name in [each for each in parent.attrib if ":" in each]:
            del parent.attrib[name]
            found.setdefault(name, []).append(parent)
    for name, elements in found.items():
        if not name.startswith("xmlns:"):
            mended.say(elements[0], Subject(f'"{name}"'), because("mend.unused", LEFT_OUT, count=len(elements)))


def _colours(mended: Mended) -> None:
    """A material that nothing gives a colour: every reader of URDFs complains of it, and nothing is drawn with it."""
    root = mended.xml.root
    for material in list(root.iter("material")):
        for color in material.findall("color"):
            if len(numbers_in(color.get("rgba", "")) or ()) != 4:
                material.remove(color)
    known = {material.get("name") for material in root.iter("material") if material.find("color") is not None}
    said: set[str | None] = set()
    for parent in [root, *root.iter("visual")]:
        for material in parent.findall("material"):
            name = material.get("name")
            if material.find("color") is not None or (name in known and parent is not root):
                continue
            parent.remove(material)
            if name not in said:
                mended.say(material, subject_of(material), because("mend.colour", LEFT_OUT))
            said.add(name)


def _names(mended: Mended) -> None:
    """Blanks and accents in names of links and joints."""
    for tag, roles in (("link", ("parent", "child")), ("joint", ())):
        elements = [element for element in mended.xml.root.findall(tag) if element.get("name")]
        known = {element.get("name", "") for element in elements}
        for element in elements:
            old = element.get("name", "")
            if re.fullmatch(r"[A-Za-z0-9_.-]+", old):
                continue
            new = mended.renamed[old] = safe_name(old, known)
            element.set("name", new)
            mended.say(element, Subject(tag, old), because("mend.name", remedy("written", text=new)))
            for joint in mended.xml.root.findall("joint"):
                for role in (joint.find(word) for word in roles or ("mimic",)):
                    if role is not None and role.get(tag) == old:
                        role.set(tag, new)


def _free_base(mended: Mended) -> None:
    fix_free_base(mended.xml, mended.warn)


def _endless(mended: Mended) -> None:
    """Limits that are infinite, or no number at all, are none: what a joint lacks is asked for."""
    for joint in mended.xml.root.findall("joint"):
        for limit in joint.findall("limit"):
            named = [key for key, text in limit.items() if any(not math.isfinite(x) for x in numbers_in(text) or ())]
            if named:
                mended.say(limit, subject_of(joint), because("mend.endless", LEFT_OUT, limits=tuple(named)))
            for key in named:
                del limit.attrib[key]


def _axes(mended: Mended) -> None:
    harmless: list[tuple[ET.Element, Subject]] = []
    for joint in mended.xml.root.findall("joint"):
        axis = joint.find("axis")
        numbers = None if axis is None else numbers_in(axis.get("xyz", "1 0 0"))
        if axis is None or numbers is None:
            continue
        length = math.sqrt(sum(value * value for value in numbers))
        where = subject_of(joint)
        if joint.get("type") not in MOVES:
            if length < 1e-9:
                harmless.append((axis, where))
            joint.remove(axis)
        elif length >= 1e-9 and abs(length - 1.0) > 1e-6:
            text = " ".join(f"{value / length:.9g}" for value in numbers)
            if abs(length - 1.0) > ROUNDED_AXIS:
                mend = remedy("written", text=f'xyz="{text}"')
                mended.say(axis, where, because("mend.axis", mend, axis=axis.get("xyz", ""), length=length))
            axis.set("xyz", text)
    for axis, where in harmless[:1]:  # some exporters write it for every frame
        what = because("mend.axis.fixed", LEFT_OUT)
        if harmless[1:]:
            what = because("mend.axis.fixed.more", LEFT_OUT, more=len(harmless) - 1)
        mended.say(axis, where, what)


def _mimics(mended: Mended) -> None:
    follow_the_motor(mended.xml, mended.say)
    for joint in mended.xml.root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") == JointKind.FIXED:
            joint.remove(mimic)  # some readers wonder aloud at it
        elif mimic is not None and joint.get("type") in MOVES:
            follows = because("mend.mimic.follows", remedy("no_motor_of_its_own"), leader=mimic.get("joint", ""))
            mended.say(mimic, subject_of(joint), follows)
