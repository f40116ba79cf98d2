"""Changes the <collision> elements of a URDF's text and nothing else: comments, order and blanks stay."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import unescape

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_LINK = re.compile(r"<link\b[^>]*?\bname\s*=\s*(?:\"([^\"]*)\"|'([^']*)')[^>]*(?<!/)>(.*?)</link\s*>", re.DOTALL)
_COLLISION = re.compile(r"[ \t]*<collision\b(?:[^>]*/>|.*?</collision\s*>)[ \t]*\r?\n?", re.DOTALL)
_VISUAL = re.compile(r"([ \t]*)<visual\b(?:[^>]*/>|.*?</visual\s*>)[ \t]*(\r?\n?)", re.DOTALL)


def with_collisions(text: str, wanted: Mapping[str, Sequence[str]]) -> str:
    """The text in which each of these links has exactly the `wanted` elements, each given as lines without indent.

    They stand behind the link's last <visual>; raises ValueError for a link that has none.
    """
    seen = _COMMENT.sub(lambda comment: " " * len(comment[0]), text)  # of equal length: places in it are places in text
    links = {unescape(match[1] or match[2] or ""): match.span(3) for match in _LINK.finditer(seen)}
    changes = [change for link, elements in wanted.items() for change in _changes(seen, links, link, elements)]
    for start, end, put in sorted(changes, reverse=True):
        text = text[:start] + put + text[end:]
    return text


def _changes(
    seen: str, links: Mapping[str, tuple[int, int]], link: str, elements: Sequence[str]
) -> list[tuple[int, int, str]]:
    """Start, end and new text, of a link's old elements and of the new ones."""
    visuals = list(_VISUAL.finditer(seen, *links[link])) if link in links else []
    if not visuals:
        raise ValueError(f'its link "{link}" has no <visual>')
    last = visuals[-1]
    indent, newline = last[1], "\r\n" if "\r\n" in seen else "\n"
    lines = [indent + line + newline for element in elements for line in element.split("\n")]
    put = "".join(lines) if last[2] else newline + "".join(lines).removesuffix(newline)
    old = [(*match.span(), "") for match in _COLLISION.finditer(seen, *links[link])]
    return [*old, (last.end(), last.end(), put)]
