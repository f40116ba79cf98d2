"""The sentence of a reason: made where a person reads it, in his language and in the terms of what he has at hand."""

from __future__ import annotations

import string
from collections.abc import Sequence
from enum import Enum
from functools import cache
from typing import Any

from gemelo.schemas.reasons.catalogue import ENGLISH, template
from gemelo.schemas.reasons.reason import PLAIN, Reason, Remedy, Value
from gemelo.schemas.reasons.units import in_display_units, in_si_units


class FrontEnd(Enum):
    """What the reader has before him: it decides how a remedy is worded, and in which units a value stands."""

    COMMAND = "command"  # `gemelo home`
    PYTHON = "python"  # arm.home()
    PAGE = "page"  # press Home


def say(reason: Reason, language: str = ENGLISH, front_end: FrontEnd = FrontEnd.COMMAND) -> str:
    """The sentence of `reason`; of a code that the language does not have, the English one."""
    return _writer(language, front_end).sentence(reason)


class _Writer(string.Formatter):
    """Puts values into the templates of one language and one front end.

    What stands behind a value's colon is its unit, or how it is worded: `word`, one that the catalogue translates, and
    `names`, each in the language's quotation marks.
    """

    def __init__(self, language: str, front_end: FrontEnd) -> None:
        self._language, self._context = language, front_end.value
        self._units = in_display_units if front_end is FrontEnd.PAGE else in_si_units

    def sentence(self, what: Reason | Remedy) -> str:
        """A code that no catalogue has, as a newer program may send it, is given as it is, with its values."""
        if what.code == PLAIN:
            return str(what.values.get("text", ""))
        found = self._template(what.code)
        if found is None:
            values = ", ".join(f"{name} {value}" for name, value in what.values.items())
            return f"{what.code} ({values})" if values else what.code
        if isinstance(what, Remedy):
            return self.vformat(found, (), _Values(what.values))
        remedies = self._either([self.sentence(each) for each in what.remedies])
        within = {"causes": "; ".join(self.sentence(cause) for cause in what.causes), "remedies": remedies}
        text = self.vformat(found, (), _Values(what.values | within))
        return text if not remedies or "{remedies}" in found else f"{text}; {remedies}"

    def format_field(self, value: Value, format_spec: str) -> str:
        """One value as it is written."""
        if format_spec == "names":
            return ", ".join(self._word("quoted").format(name=name) for name in _each(value))
        if isinstance(value, str):
            return self._word(value) if format_spec == "word" else value
        if isinstance(value, tuple):
            return ", ".join(value)
        unit, _, digits = format_spec.partition(".")
        if unit in self._units:
            return self._units[unit](float(value), int(digits) if digits else None)
        return format(value, format_spec)

    def _template(self, code: str) -> str | None:
        return template(code, self._language, self._context) or template(code, ENGLISH, self._context)

    def _word(self, word: str) -> str:
        return self._template(f"word.{word}") or word

    def _either(self, remedies: Sequence[str]) -> str:
        """Several ways to mend it."""
        return f" {self._word('or')} ".join(", ".join(part) for part in (remedies[:-1], remedies[-1:]) if part)


def _each(value: Value) -> tuple[str, ...]:
    return value if isinstance(value, tuple) else (str(value),)


class _Values(dict[str, Any]):
    """By name; one that another version of the program does not send is a question mark."""

    def __missing__(self, name: str) -> str:
        return "?"


@cache
def _writer(language: str, front_end: FrontEnd) -> _Writer:
    return _Writer(language, front_end)
