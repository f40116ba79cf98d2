"""The parser of the command line, built from the table of commands.

argparse, because the first line of output must come at once: a richer library costs 0.3 s at every start. Of all
commands only the one that was typed gets its options, so that no other command's module is loaded.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import Any, NamedTuple, NoReturn

from gemelo.tools.cli.common.errors import ExitCode, nearest

Options = argparse.Namespace
Choices = Mapping[str, Iterable[str]]  # words that may follow, by the arguments so far (joined by a blank)
ALIKE = 0.7  # of difflib's 1: a slip or another ending; chosen
_COMMA = re.compile(r"\s*([-+]?\d*),(\d+)((?:[eE][-+]?\d+)?\s*(?:[A-Za-z°%][A-Za-z0-9/^²]*)?)\s*")
_NEGATIVE_NUMBER = re.compile(r"^-(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?(?:[A-Za-z°%][A-Za-z0-9/^²]*)?$")


class Command(NamedTuple):
    """A row of the table of commands; `module:function` names a function below gemelo.tools.cli."""

    words: tuple[str, ...]  # one, or a group and one
    about: str
    run: str  # takes the parsed `Options`, returns the `ExitCode`
    add_options: str = ""  # takes the `Parser`
    example: str = ""
    choices: str = ""  # takes the `Robot` (None if its files cannot be read), returns `Choices` for completion

    def load(self, name: str) -> Callable[..., Any]:
        """Imports the module and returns the function that the field `name` refers to."""
        module, function = getattr(self, name).split(":")
        found: Callable[..., Any] = getattr(import_module(f"gemelo.tools.cli.{module}"), function)
        return found


class Parser(argparse.ArgumentParser):
    """Suggests the nearest word for a wrong one, and takes -1e-3, -20mm and -10deg/s for numbers."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self._negative_number_matcher = _NEGATIVE_NUMBER
        self.typed: Parser | None = None  # its leaf: argparse tells the root what that leaves
        self._given: Sequence[str] = ()  # what is behind the command

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does, for which a parser of a command is asked by its parent."""
        self._given = list(args or ())
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Ends the process with code 2 and one sentence."""
        if message.endswith("required: COMMAND"):
            self.print_help()
            self.exit(ExitCode.USAGE)
        wrong = re.search(r"(?:argument (\S+): )?invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if wrong is not None:
            what, said, choices = (wrong[1] or "COMMAND").lower(), wrong[2], re.findall(r"[\w-]+", wrong[3])
            guess = nearest(said, choices)
            hint = f'did you mean "{guess}"?' if guess else f"there is {', '.join(choices)}"
            message = f'no {what} "{said}": {hint}'
        left_over = re.fullmatch(r"unrecognized arguments: (\S+).*", message, re.DOTALL)
        if left_over is not None and self.typed is not None:
            self.typed.error(self.typed.left_over_message(left_over[1]))
        one_of = re.fullmatch(r"one of the arguments (.*) is required", message)
        if one_of is not None:
            message = self._with_examples(self._one_is_needed(one_of[1].split()))
        self.exit(ExitCode.USAGE, f"{self.prog}: {message}\n")

    def _one_is_needed(self, options: Sequence[str]) -> str:
        """What is said where none of the options is given, with that which a bare word seems to be meant for."""
        needed = f"say one of {', '.join(options)}"
        word = next(iter(self._given), "")
        has_places = any(not each.option_strings for each in self._actions)  # for words without an option
        if has_places or not word or word.startswith("-"):
            return needed
        names = [each for each in self._actions if set(each.option_strings) & set(options)]
        pairs = [each for each in names if "=" in str(each.metavar)]
        texts = [each for each in names if each.nargs is None and each.type is None]
        meant = [each.option_strings[0] for each in (pairs if "=" in word else texts)]
        hint = f"did you mean {meant[0]} {word}?" if meant and not word[0].isdigit() else needed
        return f'"{word}" stands without an option: {hint}'

    def left_over_message(self, word: str) -> str:
        """What is said of a word that the command does not take, with the option that is most like it."""
        options = re.findall(r"--[a-z][\w-]*", self.format_usage())
        alike = get_close_matches(word.partition("=")[0], options, 1, ALIKE) if word.startswith("-") else []
        said = f'"{word}" is no option' if word.startswith("-") else f'"{word}" is one word too many'
        there_is = f"there is {', '.join(dict.fromkeys(options))}" if options else "it has no options"
        hint = f"did you mean {alike[0]}?" if alike else there_is
        return self._with_examples(f"{said}: {hint}")

    def _with_examples(self, message: str) -> str:
        return f"{message}\nsee `{self.prog} --help`, with examples"


def build(
    commands: Iterable[Command], groups: Mapping[str, str], about: str, epilog: str, arguments: Sequence[str]
) -> Parser:
    """The parser of `gemelo` for `arguments`; what it parses carries its `Command` as `command`.

    A parser for each of 50 commands takes longer than anything else at a start, so only the typed command or group gets
    one where there is such.
    """
    commands = typed(list(commands), arguments)
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
        if command.words == tuple(arguments[: len(command.words)]):
            complete(leaf, command)
            root.typed = leaf
    return root


def typed(commands: list[Command], arguments: Sequence[str]) -> list[Command]:
    """The command that `arguments` begin with, else all of the group that they begin with, else all commands."""
    exact = [each for each in commands if each.words == tuple(arguments[: len(each.words)])]
    group = [each for each in commands if len(each.words) > 1 and list(each.words[:1]) == list(arguments[:1])]
    return exact or group or commands


def complete(leaf: Parser, command: Command) -> None:
    """Gives the parser of one command its options and its example."""
    leaf.epilog = f"example:\n  {command.example}" if command.example else None
    if command.add_options:
        command.load("add_options")(leaf)
    leaf.set_defaults(command=command)


def json_option(parser: argparse._ActionsContainer) -> None:
    """Adds --json to a parser, or to a group of one."""
    parser.add_argument("--json", action="store_true", help="JSON in SI units instead of text")


def positive_integer(text: str) -> int:
    """An argument's type: an integer above 0."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not above 0")
    return value


def comma_hint(text: str) -> str:
    """What a number with a comma was likely meant to be, as a question; empty for a text without one."""
    found = _COMMA.fullmatch(text)
    if found is None:
        return ""
    before, after, rest = found.groups()
    whole = f" or {before}{after}{rest}" if len(after) == 3 and before.lstrip("+-") not in ("", "0") else ""
    units = before if before[-1:].isdigit() else f"{before}0"
    return f"the decimal sign is a point: did you mean {units}.{after}{rest}{whole}?"


def positive_number(text: str) -> float:
    """An argument's type: a finite number above 0, in the unit that the option names."""
    if hint := comma_hint(text):
        raise argparse.ArgumentTypeError(f'"{text}": {hint}')
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not above 0 and finite")
    return value


def finite_number(text: str) -> float:
    """An argument's type: a finite number without a unit, as of a direction."""
    try:
        value = float(text)
    except ValueError:
        said = comma_hint(text) or "directions and quaternions have no unit"
        raise argparse.ArgumentTypeError(f'"{text}" is not a number: {said}') from None
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not finite")
    return value
