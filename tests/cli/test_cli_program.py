"""`gemelo program` where no stack is needed: the list, the script, and the names that a shell completes."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from gemelo.programs import Go, Program
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GEMELO_PATHS_PROGRAMS", str(tmp_path / "programs"))
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    return tmp_path / "programs"


def test_an_empty_folder_is_told_of(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["program", "list"]) is ExitCode.OK
    assert capsys.readouterr().out == f"no programs in {folder}\n"


def test_the_list_counts_steps_and_mistakes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Program("fine", (Go(state="ready"), Go(state="left")), robot="rm1").save(folder)
    Program("wrong", (Go(state="redy"),)).save(folder)
    (folder / "broken.toml").write_text("version = \n")
    (folder / "noise.toml").write_bytes(b"\xff")
    assert run(["program", "list"]) is ExitCode.OK
    rows = capsys.readouterr().out.splitlines()[2:]
    assert [row.split()[:3] for row in rows] == [
        ["broken", "?", "any"], ["fine", "2", "rm1"], ["noise", "?", "any"], ["wrong", "1", "any"],
    ]  # fmt: skip
    assert rows[3].endswith("1 mistake: gemelo program check wrong")
    assert run(["program", "list", "--json"]) is ExitCode.OK
    listed = json.loads(capsys.readouterr().out)["programs"]
    assert 'did you mean "ready"?' in listed[3]["mistakes"][0]


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("program check fine", ExitCode.NO_STACK, "no router at 127.0.0.1:1"),
        ("program run fine --from 0", ExitCode.USAGE, '"0" is no step'),
        (
            "program check wrong",
            ExitCode.FAILED,
            'line 4: step 1: rm1 has no named state "redy"; did you mean "ready"?',
        ),
        ("program run fin", ExitCode.USAGE, 'did you mean "fine"?'),
        ("program export ../x", ExitCode.USAGE, "it becomes the name of a file"),
        ("program export a\0b", ExitCode.USAGE, "control character"),
        ("program export fine a\0b", ExitCode.USAGE, "no path has a NUL in it"),
        ("program export fine /nowhere/x.py", ExitCode.USAGE, "/nowhere/x.py cannot be written: No such file"),
    ],
)
def test_what_cannot_be_is_one_sentence_with_its_code(
    line: str, code: ExitCode, said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Program("fine", (Go(state="ready"),)).save(folder)
    Program("wrong", (Go(state="redy"),)).save(folder)
    assert run(line.split(" ")) is code
    assert said in capsys.readouterr().err


def test_a_script_is_printed_or_written(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Program("fine", (Go(state="ready"),)).save(folder)
    assert run(["program", "export", "fine"]) is ExitCode.OK
    script = capsys.readouterr().out
    assert '    arm.move(named="ready", speed=speed)\n' in script
    assert run(["program", "export", "fine", str(tmp_path / "fine.py")]) is ExitCode.OK
    assert (tmp_path / "fine.py").read_text() == script


def test_names_are_completed_but_none_that_a_shell_would_carry_out(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("fine", "ñandú-2.1", "two words", "$(touch ${HOME}x)", "`id`", "a;b", "it's"):
        Program(name, ()).save(folder)
    assert run(["completion"]) is ExitCode.OK
    script = capsys.readouterr().out
    assert '"program run") words="--from --json fine ñandú-2.1" ;;' in script
    assert subprocess.run(["bash", "-c", script], cwd=tmp_path, check=True).returncode == 0
