"""The tree of commands, from the table of them. argparse, because the first word must come at once: a richer
library costs 0.3 s at every start."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

from services.cli.exits import CommandError, ExitCode
from services.cli.names import nearest
from services.cli.units import parse_value

Options = argparse.Namespace
_NEGATIVE_NUMBER = re.compile(r"^-(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?:deg|rad|mm|m|°)?$")


Words = Mapping[str, Iterable[str]]  # what may follow, by the arguments given so far, joined by a blank


def no_options(parser: Parser) -> None:
    """For a command that takes none."""


def no_words() -> Words:
    """For a command whose arguments no table knows."""
    return {}


@dataclass(frozen=True)
class Command:
    """A row of the table: its words, one line of help, its options, and what runs it."""

    words: tuple[str, ...]  # one, or a group and one
    about: str
    run: Callable[[Options], ExitCode]
    add_options: Callable[[Parser], None] = no_options
    example: str = ""
    words_after: Callable[[], Words] = no_words  # for completion


class Parser(argparse.ArgumentParser):
    """Says the nearest word where one is wrong, and takes -1e-3 and -20mm for numbers."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self._negative_number_matcher = _NEGATIVE_NUMBER

    def error(self, message: str) -> NoReturn:
        if message.endswith("required: COMMAND"):
            self.print_help()
            self.exit(ExitCode.USAGE)
        wrong = re.search(r"(?:argument (\S+): )?invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if wrong is not None:
            what, said, choices = (wrong[1] or "COMMAND").lower(), wrong[2], re.findall(r"[\w-]+", wrong[3])
            guess = nearest(said, choices)
            hint = f'did you mean "{guess}"?' if guess else f"there is {', '.join(choices)}"
            message = f'no {what} "{said}": {hint}'
        self.exit(ExitCode.USAGE, f"{self.prog}: {message}\n")


def build(commands: Iterable[Command], groups: dict[str, str], about: str, epilog: str) -> Parser:
    """The parser of `gemelo`; a parsed line carries its `Command` as `command`."""
    root = Parser(prog="gemelo", description=about, epilog=epilog, allow_abbrev=False)
    top = root.add_subparsers(metavar="COMMAND", title="commands", required=True)
    parents = {}
    for command in commands:
        *group, word = command.words
        if group and group[0] not in parents:
            parent = top.add_parser(group[0], help=groups[group[0]], description=groups[group[0]])
            parents[group[0]] = parent.add_subparsers(metavar="COMMAND", title="commands", required=True)
        where = parents[group[0]] if group else top
        leaf = where.add_parser(word, help=command.about, description=command.about, allow_abbrev=False)
        leaf.epilog = f"example:\n  {command.example}" if command.example else None
        command.add_options(leaf)
        leaf.set_defaults(command=command)
    return root


def json_option(parser: Parser) -> None:
    parser.add_argument("--json", action="store_true", help="JSON instead of text")


def positive_integer(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not above 0")
    return value


def positive_number(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and finite")
    return value


def length(text: str) -> float:
    """[m], from 0.3 or 300mm."""
    return _measured(text, "m")


def turn(text: str) -> float:
    """[rad], from 90deg or 1.57rad; a bare number is in degrees."""
    return _measured(f"{text}deg" if text[-1:].isdecimal() else text, "rad")


def _measured(text: str, unit: str) -> float:
    try:
        return parse_value(text, unit, "it")
    except CommandError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def finite_number(text: str) -> float:
    value = float(text)
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not finite")
    return value
