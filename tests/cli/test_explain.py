"""`gemelo explain` and `gemelo languages`, in process."""

from __future__ import annotations

import json
import runpy

import pytest

from gemelo.schemas import plain_text
from gemelo.schemas.reasons import catalogue
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run


@pytest.fixture
def third_language(tmp_path, monkeypatch):
    """A folder `xx` that has one text, beside the languages that there are."""
    for folder in catalogue.LANGUAGES.iterdir():
        if folder.is_dir():
            (tmp_path / folder.name).mkdir()
            (tmp_path / folder.name / catalogue.COMPILED).write_bytes((folder / catalogue.COMPILED).read_bytes())
    made = tmp_path / "made" / "xx"
    made.mkdir(parents=True)
    head = 'msgid ""\nmsgstr "Content-Type: text/plain; charset=UTF-8\\n"\n\n'
    (made / "goal.po").write_text(head + 'msgid "goal.points.none"\nmsgstr "o-o"\n')
    runpy.run_path(str(catalogue.LANGUAGES.parent / "compiled.py"))["compile_languages"](tmp_path / "made", tmp_path)
    (made / "goal.po").unlink()
    made.rmdir()
    made.parent.rmdir()
    monkeypatch.setattr(catalogue, "LANGUAGES", tmp_path)


def test_a_code_is_explained_with_an_example_and_what_would_do(capsys):
    assert run(["explain", "goal.limit.position"]) is ExitCode.OK
    text = capsys.readouterr().out
    assert "beyond what a joint may do" in text
    assert 'example: joint "brazo_joint": ' in text
    assert "what would do: stay within " in text
    assert "values: joint, value, unit, side, limit" in text


def test_a_code_is_explained_in_spanish(capsys):
    assert run(["--lang", "es", "explain", "goal.limit.position"]) is ExitCode.OK
    text = capsys.readouterr().out
    assert "más de lo que puede" in text
    assert "ejemplo: brazo_joint: " in text
    assert "qué hacer: quédese entre " in text


def test_every_code_is_listed_by_subject(capsys):
    assert run(["explain"]) is ExitCode.OK
    text = capsys.readouterr().out
    assert [code for code in catalogue.codes() if f"  {code} " not in text] == []
    assert "The gateway does not accept a trajectory." in text


def test_the_beginning_of_codes_lists_those(capsys):
    assert run(["explain", "goal.time"]) is ExitCode.OK
    text = capsys.readouterr().out
    assert "  goal.time.past " in text
    assert "goal.points" not in text


def test_a_wrong_code_is_refused_with_the_nearest(capsys):
    assert run(["explain", "goal.limit.positon"]) is ExitCode.USAGE
    assert 'no code "goal.limit.positon": did you mean "goal.limit.position"?' in capsys.readouterr().err
    assert run(["--lang", "es", "explain", "goal.limit.positon"]) is ExitCode.USAGE
    assert "¿quiso decir «goal.limit.position»?" in capsys.readouterr().err


def test_json_has_every_language_whatever_the_reader_speaks(capsys):
    printed = []
    for code in plain_text.known():
        assert run(["--lang", code, "explain", "goal.points.none", "--json"]) is ExitCode.OK
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    (found,) = json.loads(printed[0])
    assert found["code"] == "goal.points.none"
    assert found["languages"]["es"]["template"] == "El plan no tiene puntos"


def test_the_languages_that_there_are_lack_nothing(capsys):
    assert run(["languages"]) is ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == list(plain_text.known())
    assert all("all " in line for line in lines)


def test_what_a_new_language_lacks_is_counted_and_listed(third_language, capsys):
    assert run(["languages"]) is ExitCode.OK
    assert "`gemelo languages xx` lists them" in capsys.readouterr().out
    assert run(["languages", "xx"]) is ExitCode.OK
    missing = capsys.readouterr().out.splitlines()
    assert "goal.points.too_many" in missing
    assert "explain: goal" in missing
    assert "goal.points.none" not in missing
    assert run(["--lang", "xx", "explain", "goal.points.none"]) is ExitCode.OK
    assert "o-o" in capsys.readouterr().out
