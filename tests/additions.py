"""A copy of the project in which files are added or replaced: what an addition takes is tried as a person makes it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
OF_ONE_TREE = {"__pycache__", ".git", ".venv", ".mypy_cache", ".pytest_cache"}


def added(folder: Path, files: Mapping[str, str]) -> Path:
    """A project in `folder` with `files`, by their paths in it; everything else is a link to this one's."""
    front = "gemelo/__init__.py"  # of its own, as the links to the rooms beside it are then
    files = {front: (ROOT / front).read_text(), **files}
    _link(ROOT, folder, files)
    for path, text in files.items():
        (folder / path).write_text(text)
    return folder


def row_added(path: str, *, after: str, row: str) -> dict[str, str]:
    """The file with `row` behind the line `after`, which it has once."""
    text = (ROOT / path).read_text()
    assert text.count(f"{after}\n") == 1
    return {path: text.replace(f"{after}\n", f"{after}\n{row}\n")}


def run_in(project: Path, *arguments: str, **environ: str) -> subprocess.CompletedProcess[str]:
    """`python ...` with the gemelo of the project."""
    shown = {**os.environ, "PYTHONPATH": str(project), **environ}
    return subprocess.run(
        [sys.executable, *arguments], cwd=project, env=shown, capture_output=True, text=True, timeout=120, check=False
    )


def _link(here: Path, there: Path, own: Iterable[str]) -> None:
    """Links to what stands `here`, but folders that have some of their `own` files, and these files."""
    there.mkdir(exist_ok=True)
    inner: dict[str, list[str]] = {}
    for path in own:
        first, _, rest = path.partition("/")
        inner.setdefault(first, []).extend([rest] if rest else [])
    for each in here.iterdir():
        if each.name in OF_ONE_TREE:
            continue
        if inner.get(each.name):
            _link(each, there / each.name, inner[each.name])
        elif each.name not in inner:
            (there / each.name).symlink_to(os.readlink(each) if each.is_symlink() else each)
