"""XML whose faults are collected with their lines, so that a person learns of all of them at once."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, field
from xml.parsers import expat

from gemelo.libraries.arm.errors import DescriptionError

Triple = tuple[float, float, float]
MINUSES = str.maketrans({"\u2212": "-", "\u2013": "-", "\u2012": "-", "\ufe63": "-", "\uff0d": "-"})  # of print


@dataclass(frozen=True)
class XmlFault:
    """One thing that cannot be read: its line (from 1), what it belongs to, a sentence, and what would do."""

    line: int
    where: str
    message: str
    remedy: str = ""

    def __str__(self) -> str:
        remedy = f": {self.remedy}" if self.remedy else ""
        return f"line {self.line}: {self.where}: {self.message}{remedy}"


@dataclass
class XmlReader:
    """Elements with their lines; what is missing or wrong is added to `faults`, and reading goes on with a default."""

    root: ET.Element
    lines: dict[ET.Element, int] = field(default_factory=dict)
    faults: list[XmlFault] = field(default_factory=list)

    def fault(self, element: ET.Element, where: str, message: str, remedy: str = "") -> None:
        """Adds one of `element`."""
        self.faults.append(XmlFault(self.lines.get(element, 0), where, message, remedy))

    def child(self, element: ET.Element, tag: str, where: str) -> ET.Element:
        """The first child of that tag; an empty one where there is none."""
        found = element.find(tag)
        if found is None:
            self.fault(element, where, f"<{tag}> is missing", "add it")
            found = ET.Element(tag)
            self.lines[found] = 0  # it has no line: what it lacks is not said again
        return found

    def text(self, element: ET.Element, name: str, where: str) -> str:
        """An attribute that must be there; "" where it is not."""
        value = element.get(name)
        if not value:
            self._missing(element, name, where)
        return value or ""

    def number(self, element: ET.Element, name: str, where: str, default: float | None = None) -> float:
        """An attribute that is a finite number, in the unit of the file; needed where there is no `default`."""
        text = element.get(name)
        if text is None:
            if default is None:
                self._missing(element, name, where)
            return default or 0.0
        return self._finite(element, text, f"{where}: `{name}` of <{element.tag}>")

    def triple(self, element: ET.Element | None, name: str, default: Triple, where: str) -> Triple:
        """An attribute of three finite numbers [as declared]."""
        text = None if element is None else element.get(name)
        if element is None or text is None:
            return default
        words = text.split()
        if len(words) != 3:
            self.fault(element, where, f'"{text}" must be three numbers', _three(words, default))
            return default
        x, y, z = (self._finite(element, word, f"{where}: `{name}` of <{element.tag}>") for word in words)
        return x, y, z

    def _missing(self, element: ET.Element, name: str, where: str) -> None:
        if self.lines.get(element) != 0:
            self.fault(element, where, f"attribute `{name}` of <{element.tag}> is missing", "add it")

    def _finite(self, element: ET.Element, text: str, where: str) -> float:
        try:
            value = float(text)
        except ValueError:
            self.fault(element, where, f'"{text}" is not a number', _number_remedy(text))
            return 0.0
        if not math.isfinite(value):
            self.fault(element, where, f"{text} is not finite", "write a number")
            return 0.0
        return value


def _number_remedy(text: str) -> str:
    """What `text`, which is no number, was probably meant to be."""
    plain = text.strip(",;").replace(",", ".").translate(MINUSES)
    return f'write "{plain}"' if _is_number(plain) else "write a number"


def _three(words: list[str], default: Triple) -> str:
    """What three numbers these `words` were probably meant to be."""
    apart = ",".join(words).replace(";", ",").split(",")
    apart = apart * 3 if len(set(default)) == len(apart) == 1 and default[0] else [word for word in apart if word]
    known = len(apart) == 3 and all(map(_is_number, apart))
    return f'write "{" ".join(apart)}"' if known else "write x, y and z with blanks between them"


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
        raise DescriptionError(f"not XML: {error}: correct that place, or export it again") from error
    return XmlReader(builder.close(), lines)


def joined(faults: Iterable[XmlFault]) -> str:
    """Every fault on a line of its own."""
    return "\n  ".join(str(fault) for fault in faults)
