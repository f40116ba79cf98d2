"""Repairs of how a source writes numbers: in other units as a whole, as millimetres and degrees; with minus signs of
print, commas between them, and joint types in capital letters."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from gemelo.libraries.arm.checks.units import (
    LARGEST_GYRATION,
    MOST_TURN,
    gyration,
    in_millimetres_reason,
    is_drawn_in_millimetres,
)
from gemelo.libraries.arm.checks.urdf import principal_moments
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.libraries.arm.model.xml_reader import MINUSES
from gemelo.libraries.robot_import.joint_mending import FREE
from gemelo.libraries.robot_import.mended import Mended, links_of, numbers_in, subject_of, with_remedy
from gemelo.schemas.reasons import because, remedy

# Tuning constants: chosen, where a line does not say measured or standard.
MILLIMETRE, DEGREE = 0.001, math.pi / 180.0  # [m], [rad]
LEAST_TRAVEL = 1.0  # in the file's unit: a slide's travel below it is in metres, whatever the rest is in
ANGLES = math.pi / 12.0  # [rad] 15 degrees: what is a multiple of it is in radians
ANGLE_TOLERANCE = 2e-3  # [rad]
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}
TEXTS = ("name", "link", "joint", "type", "filename")  # attributes that are no numbers
SEVERAL = ("xyz", "rpy", "scale", "size")


def degrees(mended: Mended) -> None:
    """Turns in degrees, where most are beyond a turn and none is a usual one in radians."""
    origins = [each for each in mended.xml.root.iter("origin") if any(numbers_in(each.get("rpy", "")) or ())]
    turns = [abs(value) for each in origins for value in numbers_in(each.get("rpy", "")) or () if value]
    beyond = [value for value in turns if value > MOST_TURN]
    if 2 * len(beyond) <= len(turns) or any(_is_usual(value) for value in turns):
        return
    first = next(each for each in origins if max(map(abs, numbers_in(each.get("rpy", "")) or ())) > MOST_TURN)
    was = first.get("rpy", "")
    for origin in origins:
        _scaled(origin, "rpy", DEGREE)
    mend = remedy("written_in_radians", text=f'rpy="{first.get("rpy")}"')
    mended.say(first, Subject("<origin>"), because("mend.degrees", mend, rpy=was, count=len(origins)))


def lengths(mended: Mended) -> None:
    """A URDF that is drawn in millimetres as a whole; its meshes are judged for themselves."""
    if not is_drawn_in_millimetres(mended.model):
        return
    root, (why, line) = mended.xml.root, in_millimetres_reason(mended.model)
    for parent in (*root.findall("joint"), *root.findall("link"), *root.findall("link/*")):
        for origin in parent.findall("origin"):
            _scaled(origin, "xyz", MILLIMETRE)
    for tag, keys in SIZES.items():
        for shape in root.iter(tag):
            for key in keys:
                _scaled(shape, key, MILLIMETRE)
    _slides(mended)
    _moments(mended)
    said = next(element for element, at in mended.xml.lines.items() if at == line)
    mended.say(said, Subject("robot"), with_remedy(why, remedy("all_lengths_scaled")))


def _slides(mended: Mended) -> None:
    """Limits of slides, and of what follows or leads them."""
    in_metres: dict[str | None, float] = {}  # scale by joint
    joints = mended.xml.root.findall("joint")
    for joint in joints:
        limit = joint.find("limit")
        ends = [] if limit is None else [x for key in ("lower", "upper") for x in numbers_in(limit.get(key, "0")) or ()]
        if joint.get("type") == JointKind.PRISMATIC and len(ends) == 2 and abs(ends[1] - ends[0]) >= LEAST_TRAVEL:
            in_metres[joint.get("name")] = MILLIMETRE
            for key in ("lower", "upper", "velocity"):
                _scaled(limit, key, MILLIMETRE)
    for joint in joints:
        for mimic in joint.findall("mimic"):
            own, leader = in_metres.get(joint.get("name"), 1.0), in_metres.get(mimic.get("joint"), 1.0)
            if own != leader:
                mimic.set("multiplier", mimic.get("multiplier", "1"))
            _scaled(mimic, "multiplier", own / leader)
            _scaled(mimic, "offset", own)


def _moments(mended: Mended) -> None:
    """Moments of inertia in kg mm^2, which are those that no link has in kg m^2."""
    for link, model in links_of(mended):
        inertia, known = link.find("inertial/inertia"), model.inertial
        if inertia is None or known is None or not known.mass > 0.0:
            continue
        if gyration(known, principal_moments(known)[2]) > LARGEST_GYRATION:
            for key in list(inertia.attrib):
                _scaled(inertia, key, MILLIMETRE**2)


def _is_usual(turn: float) -> bool:
    """True for a turn [rad] as arms are drawn with, if it is one in radians."""
    return turn <= MOST_TURN and abs(turn - ANGLES * max(1, round(turn / ANGLES))) < ANGLE_TOLERANCE


def _scaled(element: ET.Element | None, key: str, factor: float) -> None:
    """The numbers of an attribute times `factor`, where it is there and they are numbers."""
    numbers = numbers_in(element.get(key, "")) if element is not None else None
    if element is not None and numbers:
        element.set(key, " ".join(f"{factor * value:.9g}" for value in numbers))


def minuses(mended: Mended) -> None:
    """Minus signs as word processors print them, which no program reads."""
    found: list[tuple[ET.Element, str]] = []
    for element in mended.xml.root.iter():
        for key, text in element.items():
            plain = text.translate(MINUSES)
            if key not in TEXTS and plain != text and numbers_in(plain) is not None:
                found.append((element, text))
                element.set(key, plain)
    if found:
        element, text = found[0]
        mend = remedy("written", text=f'"{text.translate(MINUSES)}"')
        mended.say(element, Subject(f"<{element.tag}>"), because("mend.minuses", mend, text=text, count=len(found)))


def separators(mended: Mended) -> None:
    """Commas between three numbers, where they are no decimal signs."""
    found: list[tuple[ET.Element, str, str]] = []
    for element in mended.xml.root.iter():
        for key in SEVERAL:
            text, words = element.get(key, ""), element.get(key, "").replace(",", " ").split()
            are_apart = len(text.split()) == 1 or ", " in text
            if "," in text and are_apart and len(words) == 3 and numbers_in(" ".join(words)):
                found.append((element, key, text))
                element.set(key, " ".join(words))
    if found:
        element, key, text = found[0]
        mend = remedy("written", text=f'{key}="{element.get(key)}"')
        commas = because("mend.commas", mend, attribute=key, text=text, count=len(found))
        mended.say(element, Subject(f"<{element.tag}>"), commas)


def capitals(mended: Mended) -> None:
    """Joint types in capital letters."""
    for joint in mended.xml.root.findall("joint"):
        kind = joint.get("type", "")
        plain = kind.strip().lower()
        if kind != plain and plain in (*JointKind, *FREE):
            joint.set("type", plain)
            mend = remedy("written", text=f'type="{plain}"')
            mended.say(joint, subject_of(joint), because("mend.capitals", mend, type=kind))
