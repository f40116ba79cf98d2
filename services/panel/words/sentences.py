"""A language of the page, and a sentence of another part in it: known by its fixed words, its values taken over.

A table has sentences with places for values, as `'joint "{joint}" is missing'`, and each in the other language. A value
is what stands at its place; one that is called as in `INSIDE` has words of its own, which must be known too, and one
that is called `word` has no blank in it.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

INSIDE = ("reason", "remedy", "more", "what")  # values that are sentences, or in the table of their place
ANY, WORD = ".+?", r"\S+?"
REMEMBERED = 512  # sentences; chosen: more than are told in a day


class Sentences:
    """`of` is a sentence in the language of the table."""

    def __init__(self, table: Mapping[str, str], values: Mapping[str, Mapping[str, str]]) -> None:
        """`values`: words that are translated where they stand at a place of that name, as a mode's."""
        by_length = sorted(table, key=lambda each: -sum(len(fixed) for fixed, *_ in _parts(each)))
        self._known = tuple((_pattern(each), table[each]) for each in by_length)  # those that say most come first
        self._values = values
        self.of = lru_cache(REMEMBERED)(self._of)

    def value(self, name: str, value: str) -> str:
        """A single value, as it stands at a place that is called `name`."""
        return self._values.get(name, {}).get(value, value)

    def _of(self, sentence: str) -> str | None:
        """None where the table has no such sentence."""
        for pattern, template in self._known:
            match = pattern.fullmatch(sentence)
            values = self._told(match.groupdict()) if match is not None else None
            if values is not None:
                return template.format(**values)
        return None

    def _told(self, found: Mapping[str, str]) -> dict[str, str] | None:
        """The values as they are put in; None where one of them is a sentence that is not known."""
        values = {}
        for name, value in found.items():
            told = self._values.get(name, {}).get(value)
            if told is None:
                told = self.of(value) if name in INSIDE else value
            if told is None:
                return None
            values[name] = told
        return values


@dataclass(frozen=True)
class Language:
    """A language of the page; a sentence of another part that it does not know stays English."""

    name: str  # as its speakers call it
    table: Mapping[str, str]  # the page's own words, by the keys of the English ones
    sentences: Sentences = field(default_factory=lambda: Sentences({}, {}))
    codes: Mapping[int, str] = field(default_factory=dict)  # of goals that the gateway rejects or aborts


def _parts(template: str) -> list[tuple[str, str | None]]:
    """Fixed words, each with the name of the value behind them."""
    return [(fixed, name) for fixed, name, _, _ in string.Formatter().parse(template)]


def _pattern(template: str) -> re.Pattern[str]:
    """Where a value stands several times, it is the same each time."""
    seen: set[str] = set()
    text = ""
    for fixed, name in _parts(template):
        text += re.escape(fixed)
        if name is not None:
            text += f"(?P={name})" if name in seen else f"(?P<{name}>{WORD if name == 'word' else ANY})"
            seen.add(name)
    return re.compile(text, re.DOTALL)
