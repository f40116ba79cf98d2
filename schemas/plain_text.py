"""Text for a terminal: the language of who reads it, and what others have written without its control characters, which
a terminal obeys: they can even write its clipboard."""

from __future__ import annotations

import re
from collections.abc import Mapping

ENGLISH = "en"
CHOSEN = "GEMELO_LANG"  # of `--lang`, for the processes that a command starts
VARIABLES = (CHOSEN, "LC_ALL", "LC_MESSAGES", "LANG")  # the first that is set decides, else as POSIX has it

# C0 but tab and newline, DEL and C1; marks and overrides of the writing direction; line and paragraph separators.
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
COLOUR = re.compile("(\x1b\\[[0-9;]*m)")  # the only sequence that a command of ours prints


def escaped(text: str) -> str:
    """The text with each control character as JSON and YAML write it, as `\\u001b`; tab and newline stay.

    A JSON text has none but within its strings, so it means the same afterwards.
    """
    return CONTROLS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def escaped_but_colours(text: str) -> str:
    """As `escaped`, and the sequences that choose a colour stay: they move nothing, and write nothing."""
    return "".join(part if index % 2 else escaped(part) for index, part in enumerate(COLOUR.split(text)))


def known() -> tuple[str, ...]:
    """The languages that there are."""
    from gemelo.schemas.reasons.catalogue import languages  # 30 ms, for another language than English alone

    return languages()


def of_environment(environ: Mapping[str, str]) -> str:
    """The language of the locale, as `es_MX.UTF-8`; English where there is no folder of it."""
    locale = next(filter(None, map(environ.get, VARIABLES)), "")
    name = locale.partition(".")[0].partition("_")[0].lower()
    return name if name not in ("", "c", "posix", ENGLISH) and name in known() else ENGLISH
