"""Every optional program of a test stands in deploy/optional, and is asked for by tests.optional."""

from __future__ import annotations

import ast
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import optional

ROOT = Path(__file__).parents[2]
# On every machine where gemelo is set up: Python, make, a compiler with its binutils, and what is essential in Debian.
BASE = {"bash", "sh", "python", "make", "c++", "cc", "nm", "unshare", "script", "setsid", "setpriv", "sleep", "true"}
MADE = {"ssh": "sshd"}  # a test writes it, or needs the row beside


def calls() -> Iterator[tuple[Path, ast.Call]]:
    for path in sorted((ROOT / "tests").rglob("*.py")):
        yield from ((path, node) for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call))


def started(call: ast.Call) -> str:
    """The program that a call of subprocess or shutil.which names itself; empty where it is none, or a path."""
    name, first = ast.unparse(call.func), call.args[0] if call.args else None
    if name.startswith("subprocess.") and isinstance(first, ast.List | ast.Tuple) and first.elts:
        first = first.elts[0]
    elif not name.endswith("which"):
        return ""
    is_named = isinstance(first, ast.Constant) and isinstance(first.value, str) and "/" not in first.value
    return first.value if is_named else ""


def test_every_program_that_a_test_starts_is_in_the_table_or_on_every_machine():
    known = BASE | set(optional.programs()) | set(MADE)
    strange = {
        f"{path.relative_to(ROOT)}: {started(call)}" for path, call in calls() if started(call) not in known | {""}
    }
    assert strange == set(), "give it a row in deploy/optional"


def test_every_name_that_a_test_needs_has_a_row_and_every_row_is_needed():
    asked = [call.args[0] for _, call in calls() if ast.unparse(call.func) == "need"]
    needed = {name.value for name in asked if isinstance(name, ast.Constant)}
    listing = subprocess.run([optional.OPTIONAL, "programs"], capture_output=True, text=True, check=True).stdout
    rows = {line.split("|")[0] for line in listing.splitlines()}
    assert needed <= rows
    assert rows - needed <= {
        "qemu",
        "openssl",
    }  # firmware/tests/rv32 needs the one, and tests start the other themselves


def test_who_starts_an_optional_program_needs_it_without_a_word(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(os, "environ", {})
    monkeypatch.setattr(optional, "lack", lambda name: f"{name} missing: sudo apt-get install {name}")
    with pytest.raises(pytest.skip.Exception, match="openssl missing: sudo apt-get install openssl"):
        subprocess.run(["openssl", "version"], check=True, capture_output=True)
