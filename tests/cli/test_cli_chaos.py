"""`gemelo chaos`, `soak` and `replay` become programs of their own; an installed wheel has neither chaos nor soak."""

from __future__ import annotations

import sys

import pytest

from gemelo.tools.cli.main import run
from gemelo.tools.cli.recording import chaos


class Became(Exception):
    """The process would be another program from here on."""


@pytest.mark.parametrize("command", ["chaos", "soak"])
@pytest.mark.parametrize("leading", [(), ("--lang", "en")])
def test_an_installation_without_it_names_what_it_needs(
    command: str, leading: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(chaos, "find_spec", lambda name: None)
    assert run([*leading, command]) == 1
    assert f"`gemelo {command}` needs a checkout of the project" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "program"),
    [
        (["chaos", "--minutes", "3"], ["gemelo.tools.chaos", "--lang", "es", "--minutes", "3"]),
        (["soak", "--hours", "1"], ["gemelo.tools.chaos.soak", "--lang", "es", "--hours", "1"]),
        (["replay", "a.mcap", "planner"], ["gemelo.tools.replay", "a.mcap", "planner"]),
    ],
)
def test_a_program_gets_what_was_typed_behind_its_command_and_the_language_before_it(
    typed: list[str], program: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    became: list[list[str]] = []

    def become(_file: str, words: list[str]) -> None:
        became.append(words)
        raise Became

    monkeypatch.setattr("os.execv", become)
    with pytest.raises(Became):
        run(["--lang", "es", *typed])
    assert became == [[sys.executable, "-m", *program]]
