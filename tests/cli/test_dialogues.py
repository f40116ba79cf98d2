"""The command line's answers against golden files, which were read in both languages."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from gemelo.tools.cli.common import language as chosen
from tests.cli.dialogues import COMMANDS, LANGUAGES, golden, said

pytestmark = pytest.mark.full  # a simulated arm for most commands


@pytest.fixture(autouse=True)
def _english_again(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("COLUMNS", "100")
    yield
    chosen.choose(chosen.ENGLISH)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_answer_is_that_of_the_golden_file(language: str) -> None:
    kept = golden(language).read_text(encoding="utf-8").split("\n\n")
    assert len(kept) == len(COMMANDS)
    for command, answer in zip(COMMANDS, kept, strict=True):
        assert said(command, language).rstrip() == answer.rstrip(), command
