"""Every path that a page, a docstring or a C++ comment of the repository names is there."""

from __future__ import annotations

import ast
import re
import subprocess
from functools import cache
from itertools import chain
from pathlib import PurePosixPath

import pytest

from gemelo.libraries.runtime.deployment import project_root
from tests.optional import need

ROOT = project_root()
SOURCE = re.compile(r"^[\w-]+\.(py|pyi|h|cpp|sh|md)$")
NAMED = re.compile(r"(?<![\w/.<*-])([\w./-]*[\w-]\.(?:py|pyi|h|cpp|md))\b")
# By PlatformIO, python3-dev, runs, and the import of docs/my_own_arm.md; an argument.
MADE = {"firmware/sdkconfig.*", "Python.h", "out/", "OUT.h", "urdf/my_arm", "urdf/my_arm/import.toml"}


@cache
def tracked() -> tuple[PurePosixPath, ...]:
    need("git")
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    paths = [PurePosixPath(line) for line in listed.stdout.splitlines()]
    return tuple(path for path in paths if (ROOT / path).is_file() or (ROOT / path).is_symlink())


@cache
def names() -> frozenset[str]:
    """The last part of every file and folder."""
    return frozenset(each.name for path in tracked() for each in (path, *path.parents))


def is_there(named: str, page: PurePosixPath) -> bool:
    """Whether a name is no path of this repository, or is one beside `page`, or from the root, or a known last part.

    A file of tests may be named as below tests/.
    """
    if named in MADE or "<" in named or named.startswith("/"):
        return True
    if "/" not in named.rstrip("/"):
        return not (SOURCE.match(named) or named.endswith("/")) or named.rstrip("/") in names()
    first = named.split("/")[0]
    if PurePosixPath(named).name.startswith("test_") and (ROOT / "tests" / named).is_file():
        return True
    bases = (ROOT, ROOT / page.parent) if first in names() or first in (".", "..") else ()
    folders = [folder for folder in bases if (folder / first).is_dir()]
    return not folders or any(any(folder.glob(named)) or (folder / named).exists() for folder in folders)


def on_page(path: PurePosixPath) -> set[str]:
    """The words in backticks that look like paths, and the targets of links."""
    text = re.sub(r"```.*?```", "", (ROOT / path).read_text(encoding="utf-8"), flags=re.DOTALL)
    words = {word for span in re.findall(r"`([^`\n]+)`", text) for word in span.split()[:1]}
    return {word for word in words if re.fullmatch(r"[\w.*/<>-]+", word) and ("/" in word or "." in word)} | {
        link for link in re.findall(r"\]\(([^)#\s]+)\)", text) if "://" not in link
    }


def in_docstrings(path: PurePosixPath) -> set[str]:
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    holders = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    texts = (ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, holders))
    return set(chain.from_iterable(map(NAMED.findall, texts)))


def in_comments(path: PurePosixPath) -> set[str]:
    comments = re.findall(r"//(.*)", (ROOT / path).read_text(encoding="utf-8"))
    return set(chain.from_iterable(map(NAMED.findall, comments)))


@pytest.mark.parametrize(
    ("suffixes", "named_in"), [({".md"}, on_page), ({".py"}, in_docstrings), ({".h", ".cpp"}, in_comments)]
)
def test_every_path_that_is_named_exists(suffixes, named_in):
    pages = [path for path in tracked() if path.suffix in suffixes and path.parts[0] != "tests"]
    assert len(pages) > 5
    absent = sorted(f"{page}: {name}" for page in pages for name in named_in(page) if not is_there(name, page))
    assert absent == []


@pytest.mark.parametrize(
    "named", ["../spheres.py", "services/planner/spheres.py", "spheres_of_old.py", "no_such_room/"]
)
def test_a_path_that_is_not_there_is_found(named):
    assert not is_there(named, PurePosixPath("services/planner/native/README.md"))


@pytest.mark.parametrize("named", ["core.py", "libraries/arm", "services/*/core.py", "plan/cancel", "../README.md"])
def test_what_is_there_or_no_path_of_ours_is_none(named):
    assert is_there(named, PurePosixPath("services/planner/native/README.md"))
