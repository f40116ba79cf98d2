"""A source under repair: its elements as they are to be written, and what was said of them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import msgspec

from gemelo.libraries.arm.checks.findings import Finding, Severity, error, note, once, warning
from gemelo.libraries.arm.checks.meshes import MeshFacts, check_meshes, facts_of
from gemelo.libraries.arm.checks.urdf import check_urdf, fault_finding
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.urdf import Geometry, UrdfLink, UrdfModel, model_of
from gemelo.libraries.arm.model.xml_reader import XmlReader
from gemelo.libraries.robot_import.questions import Questions, one_of
from gemelo.libraries.robot_import.source import RobotSource
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, Remedy, because, remedy

LEFT_OUT = remedy("left_out")


@dataclass
class Semantics:
    """What an SRDF says of a robot, by the names of its URDF."""

    file: str = ""
    groups: dict[str, tuple[str, ...]] = field(default_factory=dict)  # joints
    tips: dict[str, str] = field(default_factory=dict)  # the last link of a group's chain
    states: list[tuple[str, str, dict[str, float]]] = field(default_factory=list)  # name, group, [rad] or [m]
    pairs: dict[tuple[str, str], str] = field(default_factory=dict)  # reasons by two links, sorted

    @property
    def tip(self) -> str:
        """The last link of the largest group where that is a chain; "" where it is none."""
        largest = max(self.groups, key=lambda name: (len(self.groups[name]), name in self.tips), default="")
        return self.tips.get(largest, "")

    def state(self, name: str, joints: Sequence[str]) -> dict[str, float]:
        """The values that a state of that name gives to these joints, of all groups; empty where there is none."""
        found: dict[str, float] = {}
        for state, _, values in self.states:
            if state == name:
                found |= {joint: value for joint, value in values.items() if joint in joints}
        return found


@dataclass
class Mended:
    """The elements of a source as they are to be written, and what was said of them."""

    source: RobotSource
    xml: XmlReader
    files: dict[str, Path]  # mesh references as written, and the files that they mean
    notes: list[Finding] = field(default_factory=list)
    errors: list[Finding] = field(default_factory=list)
    sized: set[str] = field(default_factory=set)  # mesh references of whose unit a person is asked
    renamed: dict[str, str] = field(default_factory=dict)  # links and joints by the names that they had
    accelerations: dict[str, float] = field(default_factory=dict)  # [rad/s^2] or [m/s^2] by joint
    semantics: Semantics | None = None  # of the SRDF beside the source
    fits_bare: bool = False  # collision shapes for links that are only drawn
    questions: Questions = field(default_factory=lambda: Questions({}, takes_defaults=True))

    @property
    def model(self) -> UrdfModel:
        """As it is now, with what cannot be read left at a default."""
        return model_of(XmlReader(self.xml.root, self.xml.lines))[0]

    def findings(self) -> list[Finding]:
        """Everything: errors, warnings, and what is mended."""
        model, faults = model_of(XmlReader(self.xml.root, self.xml.lines))
        file = self.source.label
        found = [*self.errors, *(fault_finding(fault, file) for fault in faults)]
        found += [*check_urdf(model, Path(file), has_meshes=False), *check_meshes(model, file, self.facts, self.sized)]
        return sorted(once([*found, *self.notes]), key=lambda each: list(Severity).index(each.severity))

    def facts(self, geometry: Geometry) -> MeshFacts | Reason | None:
        """Of its mesh; None where it is none or its file is not there."""
        file = self.files.get(geometry.mesh or "")
        return None if file is None else _facts(file)

    def say(self, element: ET.Element, subject: Subject, what: Reason) -> None:
        """Notes what is mended; its remedy is what was done."""
        self.notes.append(note(self.source.label, subject, what, self.xml.lines.get(element, 0)))

    def fail(self, element: ET.Element, subject: Subject, what: Reason) -> None:
        """Says what has no one answer: an error."""
        self.errors.append(error(self.source.label, subject, what, self.xml.lines.get(element, 0)))

    def choose(self, key: str, element: ET.Element, subject: Subject, what: Reason, words: Sequence[str]) -> str | None:
        """Which of the words a person says to what has no one answer; None, after an error, where nobody is there."""
        question = because("import.ask.choice", subject.around(what), words=tuple(words))
        said = self.questions.ask_without_default(key, question, one_of(*words))
        if said is None:
            mend = remedy("correct_or_answer", key=key, answer=words[0])
            if words[1:]:
                mend = remedy("correct_or_answer_one", key=key, answer=words[0], answers=tuple(words))
            self.fail(element, subject, with_remedy(what, mend))
        return said

    def warn(self, element: ET.Element, subject: Subject, what: Reason) -> None:
        """Warns of what a default stands for that nobody has given."""
        self.notes.append(warning(self.source.label, subject, what, self.xml.lines.get(element, 0)))


@lru_cache(maxsize=256)
def _facts(file: Path) -> MeshFacts | Reason:
    return facts_of(file)


def links_of(mended: Mended) -> list[tuple[ET.Element, UrdfLink]]:
    """Each <link>, and how it was read."""
    return list(zip(mended.xml.root.findall("link"), mended.model.links, strict=True))


def meshes_of(mended: Mended) -> Iterator[tuple[ET.Element, UrdfLink, ET.Element, Geometry, ET.Element]]:
    """Link and how it was read, visual or collision and how that was read, and its <mesh>."""
    for link, model in links_of(mended):
        shapes = zip(
            (*link.findall("visual"), *link.findall("collision")), (*model.visuals, *model.collisions), strict=True
        )
        for item, geometry in list(shapes):
            mesh = item.find("geometry/mesh")
            if mesh is not None:
                yield link, model, item, geometry, mesh


def subject_of(element: ET.Element) -> Subject:
    """What a finding about a <link> or <joint> names."""
    return Subject(element.tag, element.get("name", ""))


def with_remedy(what: Reason, mend: Remedy) -> Reason:
    """The reason with what would do, or what was done."""
    return msgspec.structs.replace(what, remedies=(mend,))


def unreadable(error: Exception) -> Reason:
    """Why a file beside the source cannot be read."""
    if isinstance(error, ReasonedError):
        return because("mend.file.unreadable.as", error.reason)
    return because("mend.file.unreadable", problem=" ".join(str(error).split()))


def numbers_in(text: str) -> list[float] | None:
    """The words of an attribute as numbers (n,) in its own unit; None where one is none."""
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return None
