"""The language of a command line: that of `--lang`, else of the environment. JSON is the same in every language."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gemelo.schemas.plain_text import ENGLISH

if TYPE_CHECKING:
    from gemelo.schemas.reasons import Reason


class _Chosen:
    language = ENGLISH


def language() -> str:
    """The language of this command line."""
    return _Chosen.language


def choose(name: str) -> None:
    """The sentences of this command line are in the language `name` from now on."""
    _Chosen.language = name


def translated(text: str) -> str:
    """A text of the help, whose English stands in the program; itself where the language does not have it."""
    if language() == ENGLISH or not text:
        return text
    from gemelo.schemas.reasons.catalogue import help_text  # 30 ms, for another language than English alone

    return help_text(text, language())


def sentence(reason: Reason) -> str:
    """In the language of this command line, with its commands."""
    from gemelo.schemas.reasons import FrontEnd, say  # 30 ms, where something is refused

    return say(reason, language(), FrontEnd.COMMAND)


def word(kind: str, name: str) -> str:
    """One of the catalogue's words of a kind, as `word.column.joint`; `name` itself where there is none."""
    from gemelo.schemas.reasons.catalogue import template  # 30 ms, where something is refused

    return template(f"word.{kind}.{name}", language()) or name


def columns(*names: str) -> tuple[str, ...]:
    """The headings of a table."""
    return tuple(word("column", name) for name in names)


def reason_or(why: Reason | None, text: str) -> str:
    """The sentence of `why`; `text`, the same in English, where an older program sent it alone."""
    return text if why is None else sentence(why)
