"""Sentences of `gemelo`, said by the command line with its commands."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.tools.cli.common.errors import CommandError, ExitCode, in_commands
from gemelo.tools.cli.common.session import load_robot, reported
from gemelo.tools.cli.motion.home import home
from tests.table import table

GEMELO = Path(__file__).parents[2] / "gemelo" / "api"
METHOD = re.compile(r"\barm\.[a-z_.]+\(")


def sentences(file: Path) -> Iterator[str]:
    """The texts in the code of a module, its docstrings left out; "x" for what is put in at run time."""
    tree = ast.parse(file.read_text())
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "x" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (parts | alone):
            yield node.value


NAMING_METHODS = [text for file in sorted(GEMELO.glob("*.py")) for text in sentences(file) if METHOD.search(text)]


def test_there_are_sentences_that_name_methods() -> None:
    assert len(NAMING_METHODS) > 5


@table("text", NAMING_METHODS)
def test_every_method_that_a_sentence_names_has_its_command(text: str) -> None:
    said = in_commands(text)
    assert not METHOD.search(said)
    assert "`gemelo " in said


def test_a_joint_without_a_switch_is_told_how_it_is_declared(connected, arm, monkeypatch) -> None:
    monkeypatch.setattr(type(arm.joints[0].drive), "homing", None, raising=False)
    with pytest.raises(CommandError) as error:
        home(connected, ["efector_joint"])
    assert str(error.value).endswith("declare where it stands, `gemelo reference --joints efector_joint=...`")
    assert error.value.code is ExitCode.FAILED


def test_an_error_of_any_kind_is_said_with_commands() -> None:
    with pytest.raises(CommandError) as refused, reported(load_robot()):
        raise gemelo.Refused("the drivers are off: arm.device.arm(), then arm.home()")
    assert str(refused.value) == "the drivers are off: `gemelo device arm`, then `gemelo home`"
    assert refused.value.code is ExitCode.FAILED
    with pytest.raises(CommandError) as wrong, reported(load_robot()):
        raise gemelo.BadArgument("a joint is named twice")
    assert wrong.value.code is ExitCode.USAGE
    with pytest.raises(CommandError) as stopped, reported(load_robot()):
        raise gemelo.Interrupted("stopped")
    assert stopped.value.code is ExitCode.CANCELLED
