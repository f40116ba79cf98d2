"""The additions of CONTRIBUTING.md: every file and folder that they name is there, and a test carries each out."""

from __future__ import annotations

import re

import pytest

from tests.additions import ROOT
from tests.house.test_promises import rows

ADDITIONS = list(rows("CONTRIBUTING.md", "| to add |"))
PATH = re.compile(r"`([\w/]+(?:/|\.py))`")


@pytest.mark.parametrize("kind", ["gripper", "topic", "planner", "motor", "language", "command"])
def test_each_of_six_additions_has_its_row(kind: str) -> None:
    assert len([what for what, *_ in ADDITIONS if re.search(rf"^an? {kind}\b", what)]) == 1


@pytest.mark.parametrize(("what", "files", "test"), ADDITIONS)
def test_what_an_addition_takes_is_there_and_tried(what: str, files: str, test: str) -> None:
    assert [path for path in PATH.findall(files) if not (ROOT / path).exists()] == []
    [tried] = PATH.findall(test)
    text = (ROOT / tried).read_text(encoding="utf-8")
    assert "def test_" in text
    for path in PATH.findall(files):
        imported = path.removesuffix(".py").rstrip("/").replace("/", ".")
        assert path in text or imported in text, f"{tried} does not add to {path}, as {what} needs"
