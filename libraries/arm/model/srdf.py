"""An SRDF as plain records: groups, named states, and link pairs whose collisions are not checked."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from gemelo.libraries.arm.errors import DescriptionError, wrong_file
from gemelo.libraries.arm.model.robot_file import read_text
from gemelo.schemas.reasons import because


@dataclass(frozen=True)
class NamedState:
    """A <group_state>: the joints' values [rad] or [m]."""

    name: str
    group: str
    values: dict[str, float]


@dataclass(frozen=True)
class Group:
    """A <group>: what it names of joints, links, and chains (base, tip)."""

    name: str
    joints: tuple[str, ...]
    links: tuple[str, ...]
    chains: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class SrdfModel:
    """The content of an SRDF; `disabled` are pairs of links."""

    name: str
    groups: tuple[Group, ...]
    states: tuple[NamedState, ...]
    disabled: tuple[tuple[str, str], ...]


def read_srdf(path: Path) -> SrdfModel:
    """The SRDF in `path`; raises `DescriptionError` naming the file and the element."""
    try:
        root = ET.fromstring(read_text(path))
    except ET.ParseError as error:
        line, column = error.position
        what = because("file.xml.syntax", problem=expat.ErrorString(error.code), line=line, column=column + 1)
        raise wrong_file(path, what) from error
    try:
        return SrdfModel(
            name=root.get("name", ""),
            groups=tuple(_group(element) for element in root.findall("group")),
            states=tuple(_state(element) for element in root.findall("group_state")),
            disabled=tuple((_need(e, "link1"), _need(e, "link2")) for e in root.findall("disable_collisions")),
        )
    except DescriptionError as error:
        raise wrong_file(path, error.reason) from error


def _group(element: ET.Element) -> Group:
    return Group(
        name=_need(element, "name"),
        joints=tuple(_need(joint, "name") for joint in element.findall("joint")),
        links=tuple(_need(link, "name") for link in element.findall("link")),
        chains=tuple((_need(c, "base_link"), _need(c, "tip_link")) for c in element.findall("chain")),
    )


def _state(element: ET.Element) -> NamedState:
    name = _need(element, "name")
    values: dict[str, float] = {}
    for joint in element.findall("joint"):
        text = _need(joint, "value")
        try:
            value = values[_need(joint, "name")] = float(text)
        except ValueError as error:
            raise DescriptionError(because("srdf.state.number", state=name, text=text)) from error
        if not math.isfinite(value):
            raise DescriptionError(because("srdf.state.finite", state=name, text=text))
    return NamedState(name, _need(element, "group"), values)


def _need(element: ET.Element, name: str) -> str:
    value = element.get(name)
    if not value:
        raise DescriptionError(because("urdf.attribute.missing", attribute=name, tag=element.tag))
    return value
