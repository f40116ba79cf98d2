"""Changes the <disable_collisions> of an SRDF's text and nothing else: comments, order and blanks stay."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from html import unescape
from xml.sax.saxutils import quoteattr

Pair = frozenset[str]

_ELEMENT = re.compile(r"[ \t]*<disable_collisions\b([^>]*?)(?:/>|>\s*</disable_collisions>)[ \t]*\n?")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_ATTRIBUTE = re.compile(r"""(\w+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")


@dataclass(frozen=True)
class DisabledPair:
    """One element and where it stands in the text."""

    pair: Pair
    reason: str
    start: int
    end: int


def entries(text: str) -> list[DisabledPair]:
    """All of them, without those in comments."""
    comments = [match.span() for match in _COMMENT.finditer(text)]
    found = []
    for match in _ELEMENT.finditer(text):
        if any(start <= match.start() < end for start, end in comments):
            continue
        attributes = {name: unescape(one or other) for name, one, other in _ATTRIBUTE.findall(match[1])}
        pair = frozenset((attributes.get("link1", ""), attributes.get("link2", "")))
        found.append(DisabledPair(pair, attributes.get("reason", ""), *match.span()))
    return found


def with_pairs(text: str, wanted: Mapping[tuple[str, str], str]) -> str:
    """The text with exactly the `wanted` pairs and their reasons; raises ValueError where it has no place for them."""
    reasons = {frozenset(pair): reason for pair, reason in wanted.items()}
    present = entries(text)
    kept = {entry.pair for entry in present if reasons.get(entry.pair) == entry.reason}
    missing = [_line(pair, reason) for pair, reason in wanted.items() if frozenset(pair) not in kept]
    end = text.rfind("</robot>")
    if end < 0:
        raise ValueError("it has no </robot>")
    place = present[-1].end if present else end
    text = text[:place] + "".join(missing) + text[place:]
    for entry in reversed(present):
        if entry.pair not in kept:
            text = text[: entry.start] + text[entry.end :]
    return text


def _line(pair: tuple[str, str], reason: str) -> str:
    first, second, cause = (quoteattr(text) for text in (*pair, reason))
    return f"  <disable_collisions link1={first} link2={second} reason={cause}/>\n"
