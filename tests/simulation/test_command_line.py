"""`gemelo --simulate COMMAND`: the commands as they are, against a twin that begins and ends with each."""

from __future__ import annotations

import json
import threading

import pytest

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run


@pytest.fixture(autouse=True)
def no_router(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing listens there, so that a command which did not reach the simulation would say so."""
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")


def test_a_program_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--simulate", "program", "check", "tour"]) is ExitCode.OK
    assert "tour: it can run" in capsys.readouterr().out


def test_a_move_is_planned_only(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--simulate", "move", "--named", "left", "--plan-only"]) is ExitCode.OK
    assert "planned in" in capsys.readouterr().out


@pytest.mark.parametrize("order", [["--simulate=left", "--robot", "rm1"], ["--robot", "rm1", "--simulate=left"]])
def test_it_starts_where_it_is_asked_to(
    order: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GEMELO_ROBOT", "")  # what `--robot` sets is undone with it
    assert run([*order, "state", "--json"]) is ExitCode.OK
    assert '"brazo_joint"' in capsys.readouterr().out


def test_a_refusal_has_the_same_exit_code_and_sentence(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--simulate=unreferenced", "move", "--named", "left"]) is ExitCode.FAILED
    assert "run `gemelo home`" in capsys.readouterr().err


def test_homing_says_what_it_found(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--simulate=unreferenced", "home", "efector_joint", "--json"]) is ExitCode.OK
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert "efector_joint" in str(said)


def test_a_state_that_there_is_not_is_a_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--simulate=leftt", "state"]) is ExitCode.USAGE
    assert 'did you mean "left"?' in capsys.readouterr().err
    assert run(["--simulate=", "state"]) is ExitCode.USAGE


def test_the_next_command_is_for_the_stack_again(capsys: pytest.CaptureFixture[str]) -> None:
    threads = threading.active_count()
    assert run(["--simulate", "state"]) is ExitCode.OK
    assert threading.active_count() == threads
    assert run(["state"]) is ExitCode.NO_STACK
    assert "no router at" in capsys.readouterr().err
