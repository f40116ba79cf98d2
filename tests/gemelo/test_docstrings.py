"""Every public name says what it is, and its example does what it shows, on the whole stack of rm1."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest

import gemelo
from tests.gemelo.conftest import make_ready
from tests.gemelo.public import TABLES, documented

PUBLIC = dict(documented())
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_told_of_and_has_an_example(name: str) -> None:
    text = PUBLIC[name]
    assert text[:1].isupper() or text[:1] in '["', name
    assert ">>>" in text or name in TABLES, name


@pytest.mark.parametrize("name", [name for name, text in PUBLIC.items() if ">>>" in text])
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
    make_ready(arm)
