"""A site of three hosts as text, of which a test changes one thing."""

from __future__ import annotations

from pathlib import Path

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.site import Site
from gemelo.tools.hosts.checks import load_site

EXAMPLE = project_root() / "deploy/hosts/example.toml"


def changed(folder: Path, old: str = "", new: str = "") -> Path:
    """The example with one text in it replaced."""
    text = EXAMPLE.read_text(encoding="utf-8")
    assert old in text
    file = folder / "lab.toml"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    return file


def site(folder: Path, old: str = "", new: str = "") -> Site:
    return load_site(changed(folder, old, new), project_root())


def escaped(text: str) -> str:
    """Any text as a string of TOML, by the numbers of its characters."""
    return '"' + "".join(f"\\U{ord(each):08X}" for each in text) + '"'
