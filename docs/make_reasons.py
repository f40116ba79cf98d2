"""Puts every code of a reason into the site's pages: `python docs/make_reasons.py FOLDER`, after make_site.py FOLDER.

They do not stand in the repository's own pages: whoever adds a sentence to the catalogue changes no page.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from gemelo.schemas.reasons import FrontEnd, say
from gemelo.schemas.reasons.catalogue import codes, explanation
from gemelo.schemas.reasons.examples import example_of

PAGES = {"en": "en/reasons.md", "es": "es/motivos.md"}
MARK = "<!-- every code -->"
HEADS = {
    "en": ("code", "what it means", "example", "What would do"),
    "es": ("código", "qué significa", "ejemplo", "Qué hacer"),
}


def listed(language: str) -> str:
    """A table for each subject: every code, what it means, and an example."""
    return "\n".join(_lines(language))


def _lines(language: str) -> Iterator[str]:
    code_head, meaning_head, example_head, remedies_head = HEADS[language]
    for subject, group in groupby(sorted(codes(), key=_subject), _subject):
        yield from ("", f"### {subject or remedies_head}", "")
        whole = explanation(subject, language)
        yield from ((whole, "") if whole else ())
        yield from (f"| {code_head} | {meaning_head} | {example_head} |", "|---|---|---|")
        for code in group:
            meaning = explanation(code, language)
            sentence = say(example_of(code), language, FrontEnd.COMMAND)
            yield f"| `{code}` | {_cell(meaning if meaning != whole else '')} | {_cell(sentence)} |"


def _subject(code: str) -> str:
    """Empty for a remedy, which stands last."""
    return code.partition(".")[0] if "." in code else ""


def _cell(text: str) -> str:
    for sign, written in (
        ("&", "&amp;"),
        ("<", "&lt;"),
        ("|", "&#124;"),
        ("[", "&#91;"),
        ("*", "&#42;"),
        ("\n", "<br>"),
    ):
        text = text.replace(sign, written)
    return text


def main(site: Path) -> None:
    for language, page in PAGES.items():
        file = site / page
        file.write_text(file.read_text(encoding="utf-8").replace(MARK, listed(language)), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
