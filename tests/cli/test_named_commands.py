"""Commands that sentences advise: each is there, with the options that are named."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import polib

from gemelo.schemas.reasons.catalogue import LANGUAGES
from gemelo.tools.cli.commands import COMMANDS, Command
from gemelo.tools.cli.completion import options_of

ROOT = Path(__file__).parents[2]
OF_ALL = {"--robot", "--json", "--simulate", "--help"}
ADVICE = re.compile(r"`gemelo ([^`]+)`")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
PLACEHOLDERS = ("x", "es", "en", "...", "NAME", "COMMAND", "NOMBRE", "ORDEN")
CLASS = re.compile(r"\b[A-Z][a-z]+(?:[A-Z][a-z0-9]+)+\b")
FAMILIES = {command.words[0] for command in COMMANDS}


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


def templates(file: Path) -> Iterator[str]:
    """The texts of a catalogue's file, "x" for each value."""
    yield from (re.sub(r"\{[^{}]*\}", "x", entry.msgstr) for entry in polib.pofile(str(file)))


def advised() -> Iterator[tuple[str, str]]:
    """The file and the words behind `gemelo` of every command in a sentence."""
    for room in ("gemelo", "libraries", "services", "tools"):
        for file in sorted((ROOT / room).rglob("*.py")):
            for text in sentences(file):
                yield from ((str(file.relative_to(ROOT)), words) for words in ADVICE.findall(text))
    for file in sorted(LANGUAGES.rglob("*.po")):
        for text in templates(file):
            yield from ((file.name, words) for words in ADVICE.findall(text))


def command_of(words: list[str]) -> Command | None:
    """The longest command that these words begin with."""
    known = [each for each in COMMANDS if tuple(words[: len(each.words)]) == tuple(each.words)]
    return max(known, key=lambda each: len(each.words), default=None)


def test_every_command_that_a_sentence_advises_is_there_with_its_options():
    found = list(advised())
    assert len(found) > 150
    for file, text in found:
        words = [word for word in text.split() if word not in PLACEHOLDERS]
        while words and words[0].startswith("--"):  # as `gemelo --robot x state`
            words = words[1:]
        if not words:
            continue
        command = command_of(words)
        assert command is not None or (len(words) == 1 and words[0] in FAMILIES), f"{file}: gemelo {text}"
        if command is not None:
            unknown = set(OPTION.findall(text)) - set(options_of(command)) - OF_ALL
            assert unknown == set(), f"{file}: gemelo {text}"


def test_a_command_that_is_not_there_or_an_option_that_it_has_not_is_seen():
    assert command_of(["teleport"]) is None
    command = command_of(["device", "config", "--push"])
    assert command is not None
    assert "--push" in options_of(command)
    assert "--line" not in options_of(command)


def test_no_sentence_of_the_command_line_names_a_class_of_python():
    """But those of messages, where `gemelo interface` shows them, and the name of LeRobot's form of files."""
    for file in sorted((ROOT / "tools/cli").rglob("*.py")):
        for text in sentences(file):
            named = set(CLASS.findall(text)) if " " in text else set()
            assert named <= {"JointState", "LeRobot", "LeRobotDataset"}, f"{file}: {text}"
