"""The catalogue: the templates of all codes in one language, in gettext files by subject.

`languages/es/goal.po` has the Spanish of all codes `goal.*`. An entry's msgid is the code; its msgctxt is empty, or
names the front end that has words of its own for it (`page`), or is `explain`: what the code means, or all codes that
begin with it, or `help`: a text of the command line's help, whose English is the msgid. A template has the names of
the reason's values in braces, and behind a colon the unit of one: `{depth:m}`. The reasons behind it are `{causes}`,
`{cause_1}` and `{cause_2}` one by one, or `{lines}` where each has a line of its own; what would do is `{remedies}`,
which else follows the sentence.

`compiled.py` makes one file of a language's, which takes 1 ms to read. (Fluent's runtime takes some 100 ms to import
and 0.3 ms for each message, and so does Babel, on which it stands.)
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gettext import GNUTranslations

LANGUAGES = Path(__file__).resolve().parent / "languages"
COMPILED = "gemelo.mo"
ENGLISH = "en"
EXPLAIN, HELP = "explain", "help"
WORD = "word."  # before a word that stands in for a value
INDEX, ENTRY, PART = "index", "\x1e", "\x1f"  # as compiled.py writes it


def languages() -> tuple[str, ...]:
    """The languages that there is a folder of."""
    return tuple(sorted(folder.name for folder in LANGUAGES.iterdir() if folder.is_dir()))


def template(code: str, language: str, context: str = "") -> str | None:
    """The template for that front end, else the one for all; None where the language has none.

    None as well while the file cannot be read: a process without a free descriptor says the code and its values.
    """
    try:
        known = _catalogue(language)
    except FileNotFoundError:
        raise  # not compiled
    except OSError:
        known = None
    if known is None:
        return None
    own = known.pgettext(context, code)
    found = own if own != code else known.gettext(code)
    return found if found != code else None


def read_early() -> None:
    """Reads the English of all codes now: later a process may have no descriptor left for it."""
    _catalogue(ENGLISH)


def entries(language: str) -> frozenset[tuple[str, str]]:
    """The context and id of everything that a language has."""
    known = _catalogue(language)
    if known is None:
        return frozenset()
    parts = (each.split(PART) for each in known.pgettext(INDEX, INDEX).split(ENTRY))
    return frozenset((context, name) for context, name in parts)


def codes(language: str = ENGLISH) -> tuple[str, ...]:
    """Those of reasons and of remedies, sorted."""
    return tuple(sorted(name for context, name in entries(language) if not context and not name.startswith(WORD)))


def explanation(code: str, language: str) -> str:
    """What the code means, else what those mean that begin as it does; empty where the language says neither."""
    known, parts = _catalogue(language), code.split(".")
    names = [".".join(parts[:count]) for count in range(len(parts), 0, -1)]
    texts = ((name, known.pgettext(EXPLAIN, name)) for name in names) if known is not None else ()
    return next((text for name, text in texts if text != name), "")


def help_text(text: str, language: str) -> str:
    """The English text in the language; itself where the language does not have it."""
    known = _catalogue(language)
    return text if known is None else known.pgettext(HELP, text)


@cache
def _catalogue(language: str) -> GNUTranslations | None:
    """None of a language that there is no folder of; raises `FileNotFoundError` where setup has not compiled it."""
    folder = LANGUAGES / language
    if not folder.is_dir():
        return None
    file = folder / COMPILED
    if not file.is_file():
        raise FileNotFoundError(f"{file} is not there: the catalogue of reasons is compiled by `make setup`")
    from gettext import GNUTranslations  # 3 ms, which only who reads a sentence waits for

    with file.open("rb") as opened:
        return GNUTranslations(opened)
