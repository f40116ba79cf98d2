"""The command line's answers against golden files, which were read in both languages."""

from __future__ import annotations

import pytest

from gemelo.libraries.runtime.deployment import project_root
from tests.cli.dialogues import COMMANDS, LANGUAGES, PROMPT, golden, said

pytestmark = pytest.mark.full  # a simulated arm for most commands


@pytest.fixture(autouse=True)
def _a_hundred_columns_in_the_project(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(project_root())  # some commands name a file of it


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_answer_is_that_of_the_golden_file(language: str) -> None:
    kept = golden(language).read_text(encoding="utf-8").removeprefix(PROMPT).split(f"\n\n{PROMPT}")
    assert len(kept) == len(COMMANDS)
    for command, answer in zip(COMMANDS, kept, strict=True):
        assert said(command, language).rstrip() == f"{PROMPT}{answer}".rstrip(), command
