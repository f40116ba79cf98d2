"""`gemelo chaos` and `gemelo soak` where the project is installed without them, as a wheel has it."""

from __future__ import annotations

import pytest

from gemelo.tools.cli.main import run
from gemelo.tools.cli.recording import chaos


@pytest.mark.parametrize("command", ["chaos", "soak"])
def test_an_installation_without_it_names_what_it_needs(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(chaos, "find_spec", lambda name: None)
    monkeypatch.setattr("sys.argv", ["gemelo", command])
    assert run([command]) == 1
    assert f"`gemelo {command}` needs a checkout of the project" in capsys.readouterr().err
