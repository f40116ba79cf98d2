"""Joints that no motor of an arm turns: a base that drives or flies stands still, as does a joint that its limits lock,
and followers of followers follow the joint that has the motor.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping

from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.frames.transforms import from_axis_angle, from_rpy, multiply, rotate, to_rpy
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.libraries.arm.model.xml_reader import XmlReader
from gemelo.libraries.robot_import.limits import MOST_TRAVEL, TURN
from gemelo.libraries.robot_import.mended import Mended, subject_of
from gemelo.schemas.reasons import Reason, because, remedy

FREE = {"planar": "mend.base.drives", "floating": "mend.base.free"}  # what is said of a base by its joint's type
LEFT_BY_FIXING = ("axis", "limit", "dynamics", "mimic", "safety_controller", "calibration")

Say = Callable[[ET.Element, Subject, Reason], None]  # of `Mended`


def fix_free_base(xml: XmlReader, warn: Say) -> None:
    """Makes a planar or floating joint between the root and everything that moves a fixed one."""
    joints = xml.root.findall("joint")
    children = {_link(joint, "child") for joint in joints}
    still = {link.get("name") for link in xml.root.findall("link")} - children
    front = list(joints)
    while front:
        reached = [
            joint for joint in front if _link(joint, "parent") in still and joint.get("type") in ("fixed", *FREE)
        ]
        if not reached:
            return
        for joint in reached:
            front.remove(joint)
            still.add(_link(joint, "child"))
            if joint.get("type") in FREE:
                warn(joint, subject_of(joint), because(FREE[joint.get("type", "")], remedy("base_stands")))
                fix(joint)


def fix(joint: ET.Element) -> None:
    """Makes it a fixed one, where its origin is."""
    joint.set("type", "fixed")
    for tag in LEFT_BY_FIXING:
        for element in joint.findall(tag):
            joint.remove(element)


def stand_at(mended: Mended, places: Mapping[str, float]) -> None:
    """Fixes the joints of these names at their places [rad] or [m], and what follows them where that leads it."""
    for element, joint in zip(mended.xml.root.findall("joint"), mended.model.joints, strict=True):
        mimic = joint.mimic
        if joint.name in places:
            place = places[joint.name]
        elif mimic is not None and mimic.joint in places:
            place = mimic.multiplier * places[mimic.joint] + mimic.offset
        else:
            continue
        if place:
            _move(element, joint, place)
        fix(element)


def _move(element: ET.Element, joint: UrdfJoint, place: float) -> None:
    """Puts the origin of the joint where `place` [rad] or [m] takes its link."""
    turn, (x, y, z) = from_rpy(*joint.origin.rpy), joint.axis
    xyz, rpy = joint.origin.xyz, joint.origin.rpy
    if joint.kind is JointKind.PRISMATIC:
        along = rotate(turn, (place * x, place * y, place * z))
        xyz = (xyz[0] + along[0], xyz[1] + along[1], xyz[2] + along[2])
    else:
        rpy = to_rpy(multiply(turn, from_axis_angle(joint.axis, place)))
    for origin in element.findall("origin"):
        element.remove(origin)
    texts = {key: " ".join(f"{value:.9g}" for value in triple) for key, triple in (("xyz", xyz), ("rpy", rpy))}
    ET.SubElement(element, "origin", texts)


def fix_locked(mended: Mended) -> None:
    """Joints whose limits are one and the same place stand there; at 0 exporters write them for want of limits."""
    places = {joint.name: joint.limit.lower for joint in mended.model.joints if joint.limit and _is_locked(joint)}
    for element in mended.xml.root.findall("joint"):
        name = element.get("name", "")
        if name in places:
            unit = "m" if element.get("type") == JointKind.PRISMATIC else "rad"
            locked = because("mend.joint.locked", remedy("fixed_there"), place=places[name], unit=unit)
            mended.warn(element, subject_of(element), locked)
    stand_at(mended, places)


def _is_locked(joint: UrdfJoint) -> bool:
    most = {JointKind.REVOLUTE: TURN, JointKind.PRISMATIC: MOST_TRAVEL[JointKind.PRISMATIC]}.get(joint.kind, 0.0)
    limit = joint.limit
    return limit is not None and joint.mimic is None and limit.lower == limit.upper and 0.0 < abs(limit.lower) <= most


def follow_the_motor(xml: XmlReader, say: Say) -> None:
    """Followers of a joint that follows another itself follow that other, with the product of the multipliers."""
    joints = {joint.get("name"): joint for joint in xml.root.findall("joint")}
    mimics = {name: found for name, joint in joints.items() for found in joint.findall("mimic")}
    for name, (between, text) in {name: _composed(name, mimics) for name in mimics}.items():
        if not between or text["joint"] in mimics:
            continue  # a follower of a motor's joint, or followers in a ring, which is an error
        mend = remedy("written", text=" ".join(f'{key}="{value}"' for key, value in text.items()))
        follows = because("mend.mimic.chain", mend, between=str(between[0]), leader=text["joint"])
        say(mimics[name], subject_of(joints[name]), follows)
        mimics[name].attrib.update(text)


def _composed(name: str | None, mimics: dict[str | None, ET.Element]) -> tuple[list[str | None], dict[str, str]]:
    """The followers between joint `name` and the one with the motor, and the attributes that follow that one."""
    multiplier, offset = _numbers(mimics[name])
    leader = mimics[name].get("joint")
    between: list[str | None] = []
    while leader in mimics and leader not in (name, *between):
        between.append(leader)
        factor, addend = _numbers(mimics[leader])
        multiplier, offset = multiplier * factor, multiplier * addend + offset
        leader = mimics[leader].get("joint")
    return between, {"joint": str(leader), "multiplier": f"{multiplier:.9g}", "offset": f"{offset:.9g}"}


def _link(joint: ET.Element, role: str) -> str | None:
    element = joint.find(role)
    return None if element is None else element.get("link")


def _numbers(mimic: ET.Element) -> tuple[float, float]:
    """Multiplier, and offset [rad] or [m]; those of a plain follower where they are no numbers, which is an error."""
    try:
        return float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
    except ValueError:
        return 1.0, 0.0
