"""A source under repair: its elements as they are to be written, and what was said of them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from services.arm.checks.findings import Finding, Severity, note, once, warning
from services.arm.checks.meshes import MeshFacts, check_meshes, facts_of
from services.arm.checks.urdf import check_urdf, fault_finding
from services.arm.model.urdf import Geometry, UrdfLink, UrdfModel, model_of
from services.arm.model.xml_reader import XmlReader
from services.robot_import.source import RobotSource


@dataclass
class Mended:
    """The elements of a source as they are to be written, and what was said of them."""

    source: RobotSource
    xml: XmlReader
    files: dict[str, Path]  # mesh references as written, and the files that they mean
    notes: list[Finding] = field(default_factory=list)
    errors: list[Finding] = field(default_factory=list)

    @property
    def model(self) -> UrdfModel:
        """As it is now, with what cannot be read left at a default."""
        return model_of(XmlReader(self.xml.root, self.xml.lines))[0]

    def findings(self) -> list[Finding]:
        """Everything: errors, warnings, and what is mended."""
        model, faults = model_of(XmlReader(self.xml.root, self.xml.lines))
        file = self.source.label
        found = [*self.errors, *(fault_finding(fault, file) for fault in faults)]
        found += [*check_urdf(model, Path(file), has_meshes=False), *check_meshes(model, file, self.facts)]
        return sorted(once([*found, *self.notes]), key=lambda each: list(Severity).index(each.severity))

    def facts(self, geometry: Geometry) -> MeshFacts | str | None:
        """Of its mesh; None where it is none or its file is not there."""
        file = self.files.get(geometry.mesh or "")
        return None if file is None else _facts(file)

    def say(self, element: ET.Element, subject: str, message: str, remedy: str) -> None:
        """Notes what is mended."""
        self.notes.append(note(self.source.label, subject, message, remedy, self.xml.lines.get(element, 0)))

    def warn(self, element: ET.Element, subject: str, message: str, remedy: str) -> None:
        """Warns of what a default stands for that nobody has given."""
        self.notes.append(warning(self.source.label, subject, message, remedy, self.xml.lines.get(element, 0)))


@lru_cache(maxsize=256)
def _facts(file: Path) -> MeshFacts | str:
    return facts_of(file)


def links_of(mended: Mended) -> list[tuple[ET.Element, UrdfLink]]:
    """Each <link>, and how it was read."""
    return list(zip(mended.xml.root.findall("link"), mended.model.links, strict=True))


def subject_of(link: ET.Element) -> str:
    """What a finding about a <link> names."""
    return f'link "{link.get("name")}"'


def numbers_in(text: str) -> list[float] | None:
    """The words of an attribute as numbers (n,) in its own unit; None where one is none."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return None
