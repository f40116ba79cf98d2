"""Parameters that were saved: a process that starts again has them, and says what it cannot use."""

from __future__ import annotations

import re
import subprocess
import textwrap
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.saved_parameters import SavedParameters, toml
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.runtime.support import RouterProcess, programs

PROGRAM = """
from typing import Annotated
import msgspec
from msgspec import Meta
from gemelo.libraries.runtime.application import service

class Own(msgspec.Struct, frozen=True):
    lead: Annotated[float, Meta(gt=0, le=1)] = 0.3
    name: str = "here"
    on: bool = False

def run(node, deployment):
    own = node.parameters(Own).value
    print(own.lead, own.name, own.on, flush=True)
    node.spin(rate=20.0)

service("own", run)
"""
Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(router: RouterProcess, tmp_path: Path, monkeypatch) -> Iterator[Start]:
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(router.port))
    monkeypatch.delenv("GEMELO_ROBOT", raising=False)
    file = tmp_path / "own.py"
    file.write_text(textwrap.dedent(PROGRAM))
    with programs(router) as run_program:
        yield lambda *arguments: run_program(str(file), *arguments, GEMELO_PATHS_RUN=str(tmp_path / "run"))


def first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def end(process: subprocess.Popen[str], kill: bool = False) -> str:
    """Its errors."""
    (process.kill if kill else process.terminate)()
    return process.communicate(timeout=60.0)[1]


def test_what_was_saved_outlives_the_process_and_what_was_only_set_does_not(start: Start, tmp_path, capsys):
    process = start()
    assert first_line(process) == "0.3 here False"
    file = tmp_path / "run/parameters/own.toml"
    assert run(["param", "set", "own", "lead", "0.5", "--save"]) is ExitCode.OK
    assert capsys.readouterr().out == f"own lead: 0.3 -> 0.5, saved in {file}\n"
    assert run(["param", "set", "own", "name", 'a "b" ñ', "--save"]) is ExitCode.OK
    assert run(["param", "set", "own", "on", "true"]) is ExitCode.OK
    assert run(["param", "set", "own", "lead", "1.5", "--save"]) is ExitCode.FAILED
    end(process, kill=True)
    assert tomllib.loads(file.read_text()) == {"lead": 0.5, "name": 'a "b" ñ'}

    again = start()
    assert first_line(again) == '0.5 a "b" ñ False'
    assert f"parameters of {file}: lead, name" in end(again)
    typed = start("--set", "lead=0.7")  # the command line is nearer than the file
    assert first_line(typed) == '0.7 a "b" ñ False'
    end(typed)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('name = "there"\nlead = 1.5\n', 'own.toml, line 2: own: parameter "lead" cannot be 1.5'),
        ('name = "there"\n\nleda = 0.5\n', 'own.toml, line 3: own has no parameter "leda": did you mean "lead"?'),
        ('name = "there"\non = 1\n', 'own.toml, line 2: own: parameter "on" is a bool'),
        ('name = "there"\nlead = = 3\n', "own.toml, line 2: "),
        ('name = "there"\nlead = [0.5]\n', "own.toml, line 2: lead is [0.5], not one number, word or truth"),
    ],
)
def test_a_file_with_a_mistake_is_refused_with_its_line_and_nothing_of_it_is_used(start, tmp_path, text, said):
    file = tmp_path / "run/parameters/own.toml"
    file.parent.mkdir(parents=True)
    file.write_text(text)
    process = start()
    assert first_line(process) == "0.3 here False"
    errors = end(process)
    assert said in errors
    assert "nothing of this file is used" in errors
    assert "mend or remove it" in errors
    assert file.read_text() == text


def test_a_file_that_was_damaged_while_the_process_runs_is_not_written_over(start: Start, tmp_path, capsys):
    process = start()
    assert first_line(process) == "0.3 here False"
    file = tmp_path / "run/parameters/own.toml"
    file.parent.mkdir(parents=True)
    file.write_text("lead = = 3\n")
    assert run(["param", "set", "own", "lead", "0.5", "--save"]) is ExitCode.FAILED
    assert "own.toml, line 1" in capsys.readouterr().err
    assert run(["param", "get", "own", "lead"]) is ExitCode.OK
    assert capsys.readouterr().out == "0.3\n"  # not saved, so not set
    end(process)
    assert file.read_text() == "lead = = 3\n"


def test_where_nothing_can_be_written_nothing_is_saved(tmp_path):
    (tmp_path / "parameters").write_text("a file where the folder should be")
    saved = SavedParameters(tmp_path, "own")
    with pytest.raises(RequestRefused, match=re.escape(f"{saved.path} cannot be")):
        saved.keep({"lead": 0.5})


VALUES = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)


@given(VALUES | st.text(st.characters(exclude_categories=["Cs"])))
def test_any_value_is_read_back_as_it_was_written(value):
    assert tomllib.loads(f"x = {toml(value)}\n") == {"x": value}
