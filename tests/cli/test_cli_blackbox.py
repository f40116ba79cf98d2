"""`gemelo blackbox`: the list, one story, and every mistake in one sentence."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from gemelo.libraries.recordings.incidents import Happening, Incident, IncidentKind, is_saving, saving_mark
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.schemas.reasons import because
from gemelo.services.logger.black_box import SavingMark, write_black_box
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

SECOND = 1_000_000_000
START = 1_795_000_000 * SECOND


@pytest.fixture(autouse=True)
def out(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path))
    monkeypatch.delenv("GEMELO_ROBOT", raising=False)
    return tmp_path


@pytest.fixture
def two(out: Path) -> Path:
    for number, kind in enumerate((IncidentKind.FAULT, IncidentKind.ABORT)):
        stamp = START + number * SECOND
        incident = Incident(
            stamp=stamp, kind=kind, sentence=f"2026-11-18 11:06:4{number}.000 UTC: number {number}",
            margins=("brazo_joint at rest",), story=(Happening(at=-1.5, text="device: IDLE -> RUN"),),
        )  # fmt: skip
        write_black_box(out / "blackbox", "rm1", {}, incident, ())
    return out / "blackbox"


def test_the_list_has_the_newest_first(two, capsys):
    assert run(["blackbox", "list"]) is ExitCode.OK
    out = capsys.readouterr().out
    assert "2026-11-18 11:06:41.000 UTC" in out
    assert out.index("number 1") < out.index("number 0")
    assert run(["blackbox", "list", "--json"]) is ExitCode.OK
    assert [each["incident"]["kind"] for each in json.loads(capsys.readouterr().out)] == ["abort", "fault"]


def test_one_is_told_with_its_margins_and_its_story(two, capsys):
    assert run(["blackbox", "show"]) is ExitCode.OK
    assert capsys.readouterr().out.splitlines() == [
        "2026-11-18 11:06:41.000 UTC: number 1", "  brazo_joint at rest", "   -1.50 s  device: IDLE -> RUN",
    ]  # fmt: skip
    assert run(["blackbox", "show", "2"]) is ExitCode.OK
    assert "number 0" in capsys.readouterr().out
    (older, _) = sorted(two.glob("*.mcap"))
    assert run(["blackbox", "show", str(older), "--json"]) is ExitCode.OK
    assert json.loads(capsys.readouterr().out)["kind"] == "fault"


@pytest.fixture
def reasoned(out: Path) -> Path:
    """One whose sentences are those of reasons."""
    why = because(
        "incident.at",
        because("incident.in_goal", because("incident.emergency_stop"), elapsed=2.5, goal="4a682f77"),
        time="2026-11-18 11:06:43.500 UTC",
    )
    mode, still = because("story.mode", before="IDLE", after="ESTOP"), because("incident.at_rest")
    margin = because("incident.joint", still, joint="brazo_joint", position=0.5, unit="rad")
    incident = Incident(
        stamp=START, kind=IncidentKind.EMERGENCY_STOP, sentence=str(why), margins=(str(margin),), why=why,
        story=(Happening(at=-1.5, text=str(mode), why=mode),), margins_why=(margin,),
    )  # fmt: skip
    return write_black_box(out / "blackbox", "rm1", {}, incident, ())


def test_a_story_is_in_the_language_of_the_command_line(reasoned, capsys):
    assert run(["blackbox", "show"]) is ExitCode.OK
    assert capsys.readouterr().out.splitlines() == [
        "2026-11-18 11:06:43.500 UTC: emergency stop, 2.50 s into goal 4a682f77",
        "  brazo_joint at 28.6 deg, at rest", "   -1.50 s  device: IDLE -> ESTOP",
    ]  # fmt: skip
    assert run(["--lang", "es", "blackbox", "show"]) is ExitCode.OK
    assert capsys.readouterr().out.splitlines() == [
        "2026-11-18 11:06:43.500 UTC: parada de emergencia, a los 2.50 s del movimiento 4a682f77",
        "  brazo_joint en 28.6 deg, quieta", "   -1.50 s  equipo: en reposo -> en parada de emergencia",
    ]  # fmt: skip
    assert run(["--lang", "es", "blackbox", "list"]) is ExitCode.OK
    row = capsys.readouterr().out.splitlines()[2]
    assert row.count("parada de emergencia") == 2
    assert "emergency" not in row


def test_the_json_of_a_story_has_the_english_and_its_reasons_in_every_language(reasoned, capsys):
    said = []
    for chosen in ("en", "es"):
        assert run(["--lang", chosen, "blackbox", "show", "--json"]) is ExitCode.OK
        said.append(json.loads(capsys.readouterr().out))
    assert said[0] == said[1]
    assert said[0]["sentence"] == "2026-11-18 11:06:43.500 UTC: emergency stop, 2.50 s into goal 4a682f77"
    assert said[0]["margins_why"][0]["values"] == {"joint": "brazo_joint", "position": 0.5, "unit": "rad"}
    assert said[0]["story"][0]["why"]["code"] == "story.mode"


def test_a_file_without_reasons_is_read_in_english_in_every_language(two, capsys):
    shown = []
    for chosen in ("en", "es"):
        assert run(["--lang", chosen, "blackbox", "show"]) is ExitCode.OK
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]
    assert "brazo_joint at rest" in shown[0]
    assert run(["--lang", "es", "blackbox", "list"]) is ExitCode.OK
    assert "number 1" in capsys.readouterr().out


def test_nothing_has_happened_yet(out, capsys):
    assert run(["blackbox", "list"]) is ExitCode.OK
    assert "nothing has happened yet" in capsys.readouterr().out
    assert run(["blackbox", "open"]) is ExitCode.FAILED
    assert "nothing has happened yet" in capsys.readouterr().err


def test_one_that_is_being_saved_is_said_until_it_is_there(out, capsys):
    mark = SavingMark(out / "blackbox", "rm1")
    mark.show(True)
    assert run(["blackbox", "list"]) is ExitCode.OK
    assert run(["blackbox", "show"]) is ExitCode.FAILED
    said = capsys.readouterr()
    assert "is being saved" in said.out
    assert "is being saved" in said.err
    assert "nothing has happened" not in said.out + said.err
    mark.show(False)
    assert run(["blackbox", "list"]) is ExitCode.OK
    assert "nothing has happened yet" in capsys.readouterr().out


def test_the_mark_of_a_logger_that_was_killed_is_not_believed_for_ever(out, capsys):
    SavingMark(out / "blackbox", "rm1").show(True)
    os.utime(saving_mark(out / "blackbox", "rm1"), (START / 1e9, START / 1e9))
    assert is_saving(out / "blackbox", "rm1", START / 1e9 + 1.0)
    assert not is_saving(out / "blackbox", "rm1", START / 1e9 + 100.0)


@pytest.mark.parametrize(
    ("which", "sentence"),
    [
        ("3", "there is no black box 3: there are 1 to 2"), ("0", "there is no black box 0"),
        ("none.mcap", 'there is no file "none.mcap"'), ("-1", "-1"),
    ],
)  # fmt: skip
def test_one_that_is_not_there_is_said(two, capsys, which, sentence):
    assert run(["blackbox", "show", which]) is not ExitCode.OK
    assert sentence in capsys.readouterr().err


def test_a_recording_that_is_none_is_said(out, capsys):
    file = McapFile(out / "bag.mcap", {})
    file.close()
    assert run(["blackbox", "open", str(out / "bag.mcap")]) is not ExitCode.OK
    assert "is a recording, but no black box" in capsys.readouterr().err
