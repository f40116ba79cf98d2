"""Questions on a terminal: a wrong answer is asked again, an empty one is the default, and all can be repeated."""

from __future__ import annotations

import contextlib
import os
import pty
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.robot_import.parts import DRIVERS, MOTORS, driver_named, motor_named
from gemelo.libraries.robot_import.questions import Questions, above_zero, answers_text, read_answers, whole, yes_or_no


@contextlib.contextmanager
def typed(monkeypatch: pytest.MonkeyPatch, text: str) -> Iterator[None]:
    """A terminal on which a person types."""
    person, terminal = pty.openpty()
    os.write(person, text.encode())
    with os.fdopen(person, "w"), os.fdopen(terminal) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        yield


def test_a_wrong_answer_is_asked_again_and_an_empty_one_is_the_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    questions = Questions({}, takes_defaults=False)
    with typed(monkeypatch, "perhaps\nyes\n\nfast\n-3\n0.4\nmany\n16\n"):
        assert questions.ask("motors", "does it have motors?", "no", yes_or_no) is True
        assert questions.ask("a b.motor", "its motor", "NEMA 17", motor_named).full_steps == 200
        assert questions.ask("velocity", "how fast", "1", above_zero) == 0.4
        assert questions.ask("microsteps", "how many", "8", whole) == 16
    said = capsys.readouterr().out
    assert 'motors = "perhaps": say yes or no' in said
    assert 'velocity = "fast": it is no number' in said
    assert "it must be above 0" in said
    assert 'microsteps = "many": it is no whole number' in said
    assert "its motor [NEMA 17]" in said
    (tmp_path / "answers.toml").write_text(answers_text(questions.answers))
    assert read_answers(tmp_path / "answers.toml") == questions.answers
    again = Questions(questions.answers, takes_defaults=False)
    assert again.ask("motors", "does it have motors?", "no", yes_or_no) is True


@pytest.mark.parametrize("text", ["a = [1]", "a = ", "[joint]\nb = 1"])
def test_a_file_of_answers_that_is_none_is_refused(tmp_path: Path, text: str):
    (tmp_path / "answers.toml").write_text(text)
    with pytest.raises(DescriptionError, match=r"answers\.toml"):
        read_answers(tmp_path / "answers.toml")


def test_every_part_of_the_table_has_a_source_and_is_found_however_it_is_written():
    for part in (*MOTORS, *DRIVERS):
        assert len(part.source) > 40
    assert motor_named("nema17") is MOTORS[0]
    assert driver_named("tmc-2209").name == "TMC2209"
    for name in ("NEMA 17", "NEMA 23", "28BYJ-48"):
        assert motor_named(name).name == name
    for driver in DRIVERS:
        assert driver.usual in driver.microsteps
