"""Repairs of how numbers and joint types are written: minus signs of print, commas between numbers, capital letters."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.libraries.arm.model.xml_reader import MINUSES
from gemelo.libraries.robot_import.joint_mending import FREE
from gemelo.libraries.robot_import.mended import Mended, numbers_in

TEXTS = ("name", "link", "joint", "type", "filename")  # attributes that are no numbers
SEVERAL = ("xyz", "rpy", "scale", "size")


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
        message = f'"{text}" has a minus sign of print, as {len(found)} of its numbers have'
        mended.say(element, f"<{element.tag}>", message, f'"{text.translate(MINUSES)}"')


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
        message = f'{key}="{text}" has commas between its numbers, as {len(found)} of its triples have'
        mended.say(element, f"<{element.tag}>", message, f'{key}="{element.get(key)}"')


def capitals(mended: Mended) -> None:
    """Joint types in capital letters."""
    for joint in mended.xml.root.findall("joint"):
        kind = joint.get("type", "")
        plain = kind.strip().lower()
        if kind != plain and plain in (*JointKind, *FREE):
            joint.set("type", plain)
            mended.say(joint, f'joint "{joint.get("name")}"', f'type "{kind}" is no type', f'type="{plain}"')
