"""The sentence of a reason: made where a person reads it, in his language and in the terms of what he has at hand."""

from __future__ import annotations

import string
from collections.abc import Mapping, Sequence
from enum import Enum
from functools import cache, lru_cache
from typing import Any, Protocol

from gemelo.schemas.reasons.catalogue import ENGLISH, template
from gemelo.schemas.reasons.units import in_display_units, in_si_units

# SI units; names of joints, links, objects and hosts as they are; several numbers, or each by its joint's name
Value = bool | int | float | str | tuple[str | float, ...] | dict[str, float]
FILE = "file."  # begins the codes of what is wrong in a file
ALL, FEW = "all ", 3  # before a unit of each; chosen: how many of `few` are named
NOTHING = "-"  # the text of a remedy that a front end does not have
WITHIN = frozenset(("causes", "cause_1", "cause_2", "lines", "remedies"))  # of a template, besides the reason's values
PLAIN = "plain"  # the code of a sentence that has none of its own


class Coded(Protocol):
    """What the catalogue has a sentence for."""

    @property
    def code(self) -> str: ...
    @property
    def values(self) -> Mapping[str, Value]: ...


class Explained(Coded, Protocol):
    """With what is behind it, and what would do."""

    @property
    def causes(self) -> Sequence[Explained]: ...
    @property
    def remedies(self) -> Sequence[Coded]: ...


class FrontEnd(Enum):
    """What the reader has before him: it decides how a remedy is worded, and in which units a value stands."""

    COMMAND = "command"  # `gemelo home`
    SCRIPT = "script"  # arm.home()
    PAGE = "page"  # press Home
    FILE = "file"  # what is to be written in the file that is wrong


def say(reason: Explained, language: str = ENGLISH, front_end: FrontEnd = FrontEnd.COMMAND) -> str:
    """The sentence of `reason`; of a code that the language does not have, the English one."""
    return _writer(language, front_end).sentence(reason)


def say_apart(reason: Explained, language: str = ENGLISH, front_end: FrontEnd = FrontEnd.COMMAND) -> tuple[str, str]:
    """As `say`, the sentence without what would do, and that alone."""
    writer = _writer(language, front_end)
    return writer.sentence(reason, False), writer.remedies(reason)


class _Writer:
    """Puts values into the templates of one language and one front end.

    What stands behind a value's colon is its unit, or how it is worded: `word`, one that the catalogue translates,
    `names`, each in the quotation marks of the language, and `argument`, of which each front end has a name of its own.
    `either` puts the word for or between several, `all` the word for and, with a unit of each behind it; `few` are the
    first of many, and how many more. A number among words stands as it is.
    Of several numbers each has the unit; of numbers by their joints' names each has its own, where the unit is a value
    with as many. `word.phase` are words of that kind alone.
    """

    def __init__(self, language: str, front_end: FrontEnd) -> None:
        self._language, self._front_end, self._context = language, front_end, front_end.value
        self._units = in_display_units if front_end is FrontEnd.PAGE else in_si_units

    def sentence(self, reason: Explained, has_remedies: bool = True) -> str:
        """With what would do behind it, where the template has no other place for that."""
        writer = self._of_file if reason.code.startswith(FILE) else self
        causes = [writer._within(cause) for cause in reason.causes]
        remedies = self.remedies(reason) if has_remedies else ""
        found = self._template(reason.code)
        within = {"causes": "; ".join(causes), "lines": "\n".join(causes), "remedies": remedies}
        within |= {f"cause_{number}": cause for number, cause in enumerate(causes, start=1)}
        text = self._filled(reason, found, within)
        return text if not remedies or "{remedies}" in (found or "") else f"{text}; {remedies}"

    def remedies(self, reason: Explained) -> str:
        """What would do; empty where nothing is known."""
        texts = (self._filled(each, self._template(each.code), {}) for each in reason.remedies)
        return self._either([text for text in texts if text != NOTHING])

    def _within(self, cause: Explained) -> str:
        """As it stands in another sentence: with a small first letter, where that is of its template."""
        said, first = self.sentence(cause), (self._template(cause.code) or "")[:2]
        return said[0].lower() + said[1:] if first.istitle() and said.startswith(first) else said

    def _filled(self, what: Coded, found: str | None, within: Mapping[str, str]) -> str:
        """A code that no catalogue has, as a newer program may send it, is given as it is, with its values."""
        if what.code == PLAIN:
            return str(what.values.get("text", ""))
        if found is None:
            values = ", ".join(f"{name} {value}" for name, value in what.values.items())
            return f"{what.code} ({values})" if values else what.code
        return self._put_in(found, _Values({**what.values, **within}))

    def _put_in(self, template: str, values: Mapping[str, Any]) -> str:
        """As `str.format` does it, which takes a template apart anew each time."""
        texts = []
        for fixed, name, spec, is_quoted in _parts(template):
            texts.append(fixed)
            if name is not None:
                value = repr(values[name]) if is_quoted else values[name]
                texts.append(self.format_field(value, self._put_in(spec, values) if "{" in spec else spec))
        return "".join(texts)

    def format_field(self, value: Value, format_spec: str) -> str:
        """One value as it is written."""
        if format_spec == "names":
            return ", ".join(self._word("quoted").format(name=name) for name in _each(value))
        if format_spec == "either":
            return f" {self._word('or')} ".join(_each(value))
        if format_spec.startswith(ALL):
            each_spec = format_spec.removeprefix(ALL)
            return f" {self._word('and')} ".join(self.format_field(each, each_spec) for each in _each(value))
        if format_spec == "few":
            return self._few(_each(value))
        if format_spec == "argument":
            return self._all_of([self._argument(name) for name in _each(value)])
        if isinstance(value, str):
            return self._worded(value, format_spec) if format_spec.startswith("word") else value
        if isinstance(value, float) and format_spec.startswith("word"):
            return f"{value:g}"
        if isinstance(value, tuple):
            between = ", " if any(isinstance(each, str) for each in value) else " "
            return between.join(self.format_field(each, format_spec) for each in value)
        if isinstance(value, dict):
            units = _of_each(format_spec.split(", "), len(value))
            written = zip(value.items(), units, strict=True)
            return ", ".join(f"{name} {self.format_field(each, unit)}" for (name, each), unit in written)
        unit, _, digits = format_spec.partition(".")
        if unit in self._units:
            return self._units[unit](float(value), int(digits) if digits else None)
        return format(value, format_spec)

    def _template(self, code: str) -> str | None:
        return template(code, self._language, self._context) or template(code, ENGLISH, self._context)

    def _worded(self, value: str, spec: str) -> str:
        """One of an enumeration: by `word` alone, or among those of a kind, as `word.phase`."""
        return self._template(f"{spec}.{value}") or value

    def _word(self, word: str) -> str:
        return self._template(f"word.{word}") or word

    @property
    def _of_file(self) -> _Writer:
        """For what is wrong in a file: the page has forms for it, others write into the file."""
        return self if self._front_end is FrontEnd.PAGE else _writer(self._language, FrontEnd.FILE)

    def _argument(self, name: str) -> str:
        """Of a script, the option that does the same, or a word of the page."""
        match self._front_end:
            case FrontEnd.SCRIPT:
                return f"{name}="
            case FrontEnd.COMMAND:
                return self._template(f"word.option.{name}") or f"--{name.replace('_', '-')}"
            case FrontEnd.PAGE:
                return self._template(f"word.argument.{name}") or name
            case FrontEnd.FILE:
                return name

    def _all_of(self, names: Sequence[str]) -> str:
        """Several, the last one after the word for and."""
        return f" {self._word('and')} ".join(", ".join(part) for part in (names[:-1], names[-1:]) if part)

    def _few(self, names: Sequence[str]) -> str:
        """The first of them, and how many more there are."""
        first, count = ", ".join(names[:FEW]), len(names) - FEW
        return f"{first} {self._word('and')} {self._word('more').format(count=count)}" if count > 0 else first

    def _either(self, remedies: Sequence[str]) -> str:
        """Several ways to mend it."""
        return f", {self._word('or')} ".join(", ".join(part) for part in (remedies[:-1], remedies[-1:]) if part)


def _each(value: Value) -> tuple[str, ...]:
    return tuple(map(str, value)) if isinstance(value, tuple) else (str(value),)


def _of_each(units: Sequence[str], count: int) -> Sequence[str]:
    return units if len(units) == count else [units[0]] * count


class _Values(dict[str, Any]):
    """By name; one that another version of the program does not send is a question mark."""

    def __missing__(self, name: str) -> str:
        return "?"


@lru_cache(maxsize=4096)  # chosen: more than the templates of all languages
def _parts(template: str) -> tuple[tuple[str, str | None, str, bool], ...]:
    """Fixed words, each with name and specification of the value behind them; true where that is `{name!r}`."""
    parsed = string.Formatter().parse(template)
    return tuple((fixed, name, spec or "", conversion == "r") for fixed, name, spec, conversion in parsed)


@cache
def _writer(language: str, front_end: FrontEnd) -> _Writer:
    return _Writer(language, front_end)
