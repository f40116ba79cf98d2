"""One change to a file of a robot's folder."""

from __future__ import annotations

from pathlib import Path


def edit(file: Path, old: str, new: str) -> None:
    """The first `old` becomes `new`; it must be there."""
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
