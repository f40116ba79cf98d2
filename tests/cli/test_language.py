"""The language of the command line: what decides it, and that data stays the same in every language."""

from __future__ import annotations

import json

import pytest

import gemelo
from gemelo.schemas import plain_text
from gemelo.schemas.reasons import FrontEnd, say
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.table import table


@pytest.fixture(scope="module")
def plan_from_elsewhere(tmp_path_factory) -> str:
    path = str(tmp_path_factory.mktemp("plan") / "plan.json")
    with gemelo.simulate("rm1", start="left") as arm:
        arm.plan(named="ready").save(path)
    return path


@table(
    "environ, wanted",
    [
        ({}, "en"),
        ({"LANG": "C.UTF-8"}, "en"),
        ({"LANG": "es_MX.UTF-8"}, "es"),
        ({"LANG": "es"}, "es"),
        ({"LANG": "de_DE.UTF-8"}, "en"),
        ({"LANG": "es_ES", "LC_ALL": "en_US.UTF-8"}, "en"),
        ({"LANG": "en_US", "LC_MESSAGES": "es_AR.UTF-8"}, "es"),
        ({"LANG": "es_ES", "LC_ALL": ""}, "es"),
        ({"LANG": "en_US", "GEMELO_LANG": "es"}, "es"),
    ],
)
def test_the_first_variable_that_is_set_decides(environ, wanted):
    assert plain_text.of_environment(environ) == wanted


def test_a_refusal_is_printed_in_the_language_of_the_option(plan_from_elsewhere, capsys):
    words = ["--simulate", "move", "--execute", plan_from_elsewhere]
    assert run(["--lang", "es", *words]) is ExitCode.FAILED
    spanish = capsys.readouterr().err
    assert run(words) is ExitCode.FAILED
    english = capsys.readouterr().err
    assert spanish.startswith("gemelo: Lo rechaza stepper_gateway: ")
    assert "el plan empieza en" in spanish
    assert english.startswith("gemelo: refused by stepper_gateway: ")
    assert "the trajectory starts at" in english


def test_a_refusal_is_printed_in_the_language_of_the_locale(plan_from_elsewhere, capsys, monkeypatch):
    monkeypatch.setenv("LANG", "es_MX.UTF-8")
    assert run(["--simulate", "move", "--execute", plan_from_elsewhere]) is ExitCode.FAILED
    assert "el plan empieza en" in capsys.readouterr().err


def test_what_a_command_starts_speaks_its_language_and_the_next_command_its_own(capfd):
    """The shapes are fitted in a process of its own."""
    command = ["collision", "fit", "urdf/rm1"]
    assert run(["--lang", "es", *command]) is ExitCode.OK
    assert capfd.readouterr().out.startswith("eslabón ")
    assert run(command) is ExitCode.OK
    assert capfd.readouterr().out.startswith("link ")


def test_json_is_the_same_in_every_language(capsys):
    printed = []
    for code in plain_text.known():
        assert run(["--lang", code, "topic", "list", "--json"]) is ExitCode.OK
        printed.append(json.loads(capsys.readouterr().out))
    assert len(printed) >= 2
    assert all(each == printed[0] for each in printed)


def test_a_language_that_there_is_no_folder_of_is_refused_with_those_that_there_are(capsys):
    assert run(["--lang", "xx", "version"]) is ExitCode.USAGE
    assert 'no language "xx": there is en, es' in capsys.readouterr().err
    assert run(["--lang"]) is ExitCode.USAGE
    assert "--lang LANGUAGE" in capsys.readouterr().err


def test_a_script_has_the_sentence_with_its_own_methods():
    error = gemelo.Refused("x")
    assert str(error) == say(error.message, "en", FrontEnd.SCRIPT)
    assert error.reason == error.message
