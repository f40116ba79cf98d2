"""XML whose faults are collected with their lines, so that a person learns of all of them at once."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.parsers import expat

from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.schemas.reasons import Reason, Remedy, because, remedy

Triple = tuple[float, float, float]
MINUSES = str.maketrans({"\u2212": "-", "\u2013": "-", "\u2012": "-", "\ufe63": "-", "\uff0d": "-"})  # of print


@dataclass(frozen=True)
class XmlFault:
    """One thing that cannot be read: its line (from 1), what it belongs to, and what is wrong with what would do."""

    line: int
    of: Subject
    what: Reason

    @property
    def reason(self) -> Reason:
        """With its place."""
        return because("finding.line", self.of.around(self.what), line=self.line)

    def __str__(self) -> str:
        return str(self.reason)


@dataclass
class XmlReader:
    """Elements with their lines; what is missing or wrong is added to `faults`, and reading goes on with a default."""

    root: ET.Element
    lines: dict[ET.Element, int] = field(default_factory=dict)
    faults: list[XmlFault] = field(default_factory=list)

    def fault(self, element: ET.Element, where: Subject, what: Reason) -> None:
        """Adds one of `element`."""
        self.faults.append(XmlFault(self.lines.get(element, 0), where, what))

    def child(self, element: ET.Element, tag: str, where: Subject) -> ET.Element:
        """The first child of that tag; an empty one where there is none."""
        found = element.find(tag)
        if found is None:
            self.fault(element, where, because("urdf.element.missing", remedy("add_it"), tag=tag))
            found = ET.Element(tag)
            self.lines[found] = 0  # it has no line: what it lacks is not said again
        return found

    def text(self, element: ET.Element, name: str, where: Subject) -> str:
        """An attribute that must be there; "" where it is not."""
        value = element.get(name)
        if not value:
            self._missing(element, name, where)
        return value or ""

    def number(self, element: ET.Element, name: str, where: Subject, default: float | None = None) -> float:
        """An attribute that is a finite number, in the unit of the file; needed where there is no `default`."""
        text = element.get(name)
        if text is None:
            if default is None:
                self._missing(element, name, where)
            return default or 0.0
        return self._finite(element, text, name, where)

    def triple(self, element: ET.Element | None, name: str, default: Triple, where: Subject) -> Triple:
        """An attribute of three finite numbers [as declared]."""
        text = None if element is None else element.get(name)
        if element is None or text is None:
            return default
        words = text.split()
        if len(words) != 3:
            what = because("urdf.value.three", _three(words, default), text=text, attribute=name, tag=element.tag)
            self.fault(element, where, what)
            return default
        x, y, z = (self._finite(element, word, name, where) for word in words)
        return x, y, z

    def _missing(self, element: ET.Element, name: str, where: Subject) -> None:
        if self.lines.get(element) != 0:
            what = because("urdf.attribute.missing", remedy("add_it"), attribute=name, tag=element.tag)
            self.fault(element, where, what)

    def _finite(self, element: ET.Element, text: str, name: str, where: Subject) -> float:
        try:
            value = float(text)
        except ValueError:
            mend = _number_remedy(text)
            self.fault(element, where, because("urdf.value.number", mend, text=text, attribute=name, tag=element.tag))
            return 0.0
        if not math.isfinite(value):
            mend = remedy("write_a_number")
            self.fault(element, where, because("urdf.value.finite", mend, text=text, attribute=name, tag=element.tag))
            return 0.0
        return value


def _number_remedy(text: str) -> Remedy:
    """What `text`, which is no number, was probably meant to be."""
    plain = text.strip(",;").replace(",", ".").translate(MINUSES)
    return remedy("write_text", text=plain) if _is_number(plain) else remedy("write_a_number")


def _three(words: list[str], default: Triple) -> Remedy:
    """What three numbers these `words` were probably meant to be."""
    apart = ",".join(words).replace(";", ",").split(",")
    apart = apart * 3 if len(set(default)) == len(apart) == 1 and default[0] else [word for word in apart if word]
    known = len(apart) == 3 and all(map(_is_number, apart))
    return remedy("write_text", text=" ".join(apart)) if known else remedy("write_three")


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def parse_xml(text: str) -> XmlReader:
    """Elements, comments left out, with the line that each begins in; raises `DescriptionError` where it is no XML."""
    parser, builder = expat.ParserCreate("utf-8"), ET.TreeBuilder()
    lines: dict[ET.Element, int] = {}

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    try:
        # Whatever encoding the declaration names, the text is decoded, and is UTF-8 here.
        parser.Parse(text.encode("utf-8"), True)
    except expat.ExpatError as error:
        problem = expat.ErrorString(error.code)
        what = because("file.xml.syntax", problem=problem, line=error.lineno, column=error.offset + 1)
        raise DescriptionError(what) from error
    return XmlReader(builder.close(), lines)


def joined(faults: Iterable[XmlFault]) -> Reason:
    """Every fault on a line of its own."""
    return because("urdf.faults", *(fault.reason for fault in faults))
