"""Compiles the catalogue: all gettext files of a language into one, when a checkout or a wheel is made."""

from __future__ import annotations

import sys
from pathlib import Path

import polib

COMPILED = "gemelo.mo"  # as catalogue.py reads it; this file runs alone where the project is built
INDEX, ENTRY, PART = "index", "\x1e", "\x1f"  # what there is, which gettext itself does not list


def compile_languages(sources: Path, to: Path) -> list[Path]:
    """Writes `to/<language>/gemelo.mo` of each folder of `sources`; raises `ValueError` for a code given twice."""
    return [_compile(folder, to / folder.name) for folder in sorted(sources.iterdir()) if folder.is_dir()]


def _compile(folder: Path, to: Path) -> Path:
    whole = polib.POFile()
    whole.metadata = {"Content-Type": "text/plain; charset=UTF-8", "Language": folder.name}
    seen: set[tuple[str, str]] = set()
    for file in sorted(folder.glob("*.po")):
        for entry in polib.pofile(str(file)):
            if (key := (entry.msgctxt or "", entry.msgid)) in seen:
                raise ValueError(f"{file}: {entry.msgid} stands twice: take one of the two away")
            seen.add(key)
            whole.append(entry)
    index = ENTRY.join(PART.join(each) for each in sorted(seen))
    whole.append(polib.POEntry(msgctxt=INDEX, msgid=INDEX, msgstr=index))
    to.mkdir(parents=True, exist_ok=True)
    whole.save_as_mofile(str(to / COMPILED))
    return to / COMPILED


if __name__ == "__main__":
    here = Path(sys.argv[1])
    compile_languages(here, here)
