"""Every public name says what it is, and its example does what it shows, on a simulated rm1."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest

import gemelo
from tests.gemelo.public import TABLES, documented

PUBLIC = dict(documented())
ON_THE_STACK = {"Lost"}  # of which tests/stack/test_scripts.py runs the example
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def test_every_public_name_is_told_of_and_has_an_example() -> None:
    assert [name for name, text in PUBLIC.items() if not (text[:1].isupper() or text[:1] in '["')] == []
    assert [name for name, text in PUBLIC.items() if ">>>" not in text and name not in TABLES] == []


@pytest.mark.parametrize("name", [name for name, text in PUBLIC.items() if ">>>" in text and name not in ON_THE_STACK])
def test_an_example_does_what_it_shows(
    name: str, arm: gemelo.Arm, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(root)
    names = {"gemelo": gemelo, "arm": arm, "folder": str(tmp_path)}
    test = doctest.DocTestParser().get_doctest(PUBLIC[name], names, name, None, 0)
    said: list[str] = []
    results = doctest.DocTestRunner(optionflags=OPTIONS).run(test, out=said.append)
    assert results.attempted > 0
    assert results.failed == 0, "".join(said)
