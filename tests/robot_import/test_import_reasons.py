"""Tests of the reasons for which an import cannot begin or go on: codes with values, and each language's sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.robot_import.questions import Questions, above_zero, one_of, read_answers, whole
from gemelo.libraries.robot_import.source import find_source
from gemelo.schemas.reasons import Reason, because, remedy, say

ROBOT = '<robot name="a"><link name="base"/></robot>'


def reason_of(source: Path, arguments: dict[str, str] | None = None) -> Reason:
    with pytest.raises(DescriptionError) as caught:
        find_source(source, arguments or {})
    return caught.value.reason


def test_what_is_no_source_says_why_with_its_place(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    assert reason_of(gone) == because("file.wrong", because("import.source.none"), file=str(gone))
    assert reason_of(tmp_path) == because("file.wrong", because("import.source.no_robot"), file=str(tmp_path))
    for name in ("a.urdf", "b.urdf"):
        (tmp_path / name).write_text(ROBOT)
    several = because("import.source.several", count=2, names=("a.urdf", "b.urdf"))
    assert reason_of(tmp_path) == because("file.wrong", several, file=str(tmp_path))
    assert "hay 2 robots en ella (a.urdf, b.urdf)" in say(reason_of(tmp_path), "es")
    no_xacro = because("import.xacro.none", names=("long",))
    urdf = tmp_path / "a.urdf"
    assert reason_of(urdf, {"long": "1"}) == because("file.wrong", no_xacro, file=str(urdf))


def test_what_the_sandbox_of_a_xacro_file_refuses_says_why_with_its_place(tmp_path: Path) -> None:
    """Whether the process that expands it refuses, or its keeper."""
    folder = tmp_path / "robot"
    folder.mkdir()
    file = folder / "arm.urdf.xacro"

    def refused(content: str) -> Reason:
        head = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        file.write_text(f"{head}\n{content}\n</robot>")
        return reason_of(file)

    lambda_ = because("import.xacro.not_admitted", what="Lambda")
    expression = because("import.xacro.expression", lambda_, text="(lambda: 1)()")
    assert refused('<link name="${(lambda: 1)()}"/>') == because("file.line", expression, file=str(file), line=2)
    assert "`(lambda: 1)()`: no se admite Lambda: una expresión puede tener" in say(
        because("file.wrong", expression), "es"
    )
    environment = because("import.xacro.environment", name="TOKEN")
    assert refused('<link name="$(env TOKEN)"/>') == because("file.wrong", environment, file=str(file))
    (tmp_path / "beside.yaml").write_text("a: 1")
    outside = refused("<link name=\"${xacro.load_yaml('../beside.yaml')['a']}\"/>")
    named = because("import.xacro.outside", file=str(folder / "../beside.yaml"), folders=(str(folder),))
    assert outside == because("file.wrong", named, file=str(file))


def test_an_answer_that_is_none_says_why() -> None:
    cases = ((whole, "x", because("import.answer.whole")), (above_zero, "0", because("import.answer.above_zero")),
             (one_of("a", "b"), "c", because("import.answer.none_of", known=("a", "b"))))  # fmt: skip
    for parse, text, why in cases:
        with pytest.raises(DescriptionError) as caught:
            Questions({"key": text}, takes_defaults=True).ask("key", "which?", "a", parse)
        assert caught.value.reason == because("import.answer", why, key="key", text=text)


def test_a_misspelt_answer_names_the_nearest(tmp_path: Path) -> None:
    file = tmp_path / "answers.toml"
    file.write_text('motor = "x"\nmany = ["a", "b"]\n')
    with pytest.raises(DescriptionError) as caught:
        read_answers(file)
    assert caught.value.reason == because("file.wrong", because("import.answers.several", key="many"), file=str(file))
    questions = Questions({"motor": "x"}, takes_defaults=True)
    questions.ask("motors", "which?", "none", str)
    near = remedy("did_you_mean", name="motors")
    assert questions.unused() == [because("import.answers.key", near, key="motor")]
