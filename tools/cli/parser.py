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
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown, usage
from gemelo.tools.cli.common.language import sentence, translated

if TYPE_CHECKING:
    from gemelo.schemas.reasons import Reason, Remedy, Value

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


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Help in the language of the command line."""

    def start_section(self, heading: str | None) -> None:
        super().start_section(translated(heading or "") or None)

    def add_text(self, text: str | None) -> None:
        super().add_text(
            "\n\n".join(map(_paragraph, text.split("\n\n"))) if text and text != argparse.SUPPRESS else text
        )

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: str | None = None) -> None:
        super().add_usage(usage, actions, groups, translated("usage: ") if prefix is None else prefix)

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return translated(action.help) if action.help else action.help


def _paragraph(text: str) -> str:
    """As a whole, else its heading alone: what stands below `examples:` is typed so in every language."""
    heading, *lines = text.split("\n")
    whole = translated(text)
    return whole if whole != text else "\n".join([translated(heading), *lines])


def _translated_plural(singular: str, plural: str, count: int) -> str:
    return translated(singular if count == 1 else plural)


# argparse asks gettext for its messages by these two names, and decides when it says which.
argparse._ = translated  # type: ignore[attr-defined]
argparse.ngettext = _translated_plural  # type: ignore[attr-defined]
ONE_OF = "one of the arguments %s is required"  # the one message of argparse that ours replace


class Parser(argparse.ArgumentParser):
    """Suggests the nearest word for a wrong one, and takes -1e-3, -20mm and -10deg/s for numbers."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=HelpFormatter, **settings)
        self._negative_number_matcher = _NEGATIVE_NUMBER
        self.typed: Parser | None = None  # its leaf, which knows what it does not take
        self._given: Sequence[str] = ()  # what is behind the command
        self._has_commands = False

    def add_commands(self) -> Any:
        """The commands below it, of which one is needed; without one the help is printed."""
        self._has_commands = True
        return self.add_subparsers(metavar="COMMAND", title="commands")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Ends the process with one sentence where a word is left over."""
        found, left = self.parse_known_args(args, namespace)
        if left:
            (self.typed or self)._refuse_left_over(left[0])
        return found

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does, for which a parser of a command is asked by its parent."""
        self._given = list(args or ())
        found, left = super().parse_known_args(args, namespace)
        if self._has_commands and getattr(found, "command", None) is None:
            self.print_help()
            self.exit(ExitCode.USAGE)
        return found, left

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Ends the process where a word is none of the choices."""
        choices = list(action.choices or ())
        if action.choices is not None and value not in choices:
            what = next(iter(action.option_strings), None) or str(action.metavar or action.dest)
            self.refuse(unknown(what.lower(), str(value), choices, is_sorted=False))

    def error(self, message: str) -> NoReturn:
        """Ends the process with code 2 and one sentence; `message` is argparse's, in the language."""
        for group in self._mutually_exclusive_groups:
            options = ["/".join(each.option_strings) for each in group._group_actions]
            if message == ONE_OF % " ".join(options):
                self._refuse_without_any(options)
        self.exit(ExitCode.USAGE, f"{self.prog}: {message}\n")

    def refuse(self, error: CommandError) -> NoReturn:
        """Ends the process with its code and sentence."""
        self.exit(error.code, f"{self.prog}: {error}\n")

    def _refuse_with_help(self, reason: Reason) -> NoReturn:
        from gemelo.schemas.reasons import because  # 30 ms, where something is refused

        self.refuse(usage(because("cli.parser.see_help", reason, program=self.prog)))

    def _refuse_without_any(self, options: Sequence[str]) -> NoReturn:
        """Where none of the options is given, with that which a bare word seems to be meant for."""
        from gemelo.schemas.reasons import because, remedy  # 30 ms, where something is refused

        needed = ", ".join(options)
        word = next(iter(self._given), "")
        has_places = any(not each.option_strings for each in self._actions)  # for words without an option
        if has_places or not word or word.startswith("-"):
            self._refuse_with_help(because("cli.parser.one_of", options=needed))
        names = [each for each in self._actions if set(each.option_strings) & set(options)]
        pairs = [each for each in names if "=" in str(each.metavar)]
        texts = [each for each in names if each.nargs is None and each.type is None]
        meant = [each.option_strings[0] for each in (pairs if "=" in word else texts)]
        is_clear = meant and not word[0].isdigit()
        guess = remedy("did_you_mean_option", option=f"{meant[0]} {word}") if is_clear else None
        hint = guess or remedy("say_one_of", options=needed)
        self._refuse_with_help(because("cli.parser.without_option", hint, word=word))

    def _refuse_left_over(self, word: str) -> NoReturn:
        """Where the command does not take a word, with the option that is most like it."""
        from gemelo.schemas.reasons import because, remedy  # 30 ms, where something is refused

        long = ([text for text in each.option_strings if text.startswith("--")] for each in self._actions)
        options = [texts[0] for texts in long if texts and texts[0] != "--help"]
        is_option = word.startswith("-")
        alike = get_close_matches(word.partition("=")[0], options, 1, ALIKE) if is_option else []
        if alike:
            hint = remedy("did_you_mean_option", option=alike[0])
        else:
            hint = remedy("there_is", names=", ".join(options)) if options else remedy("has_no_options")
        code = "cli.parser.no_option" if is_option else "cli.parser.one_too_many"
        self._refuse_with_help(because(code, hint, word=word))


def build(
    commands: Iterable[Command], groups: Mapping[str, str], about: str, epilog: str, arguments: Sequence[str]
) -> Parser:
    """The parser of `gemelo` for `arguments`; what it parses carries its `Command` as `command`.

    A parser for each of 50 commands takes longer than anything else at a start, so only the typed command or group gets
    one where there is such.
    """
    commands = typed(list(commands), arguments)
    root = Parser(prog="gemelo", description=about, epilog=epilog, allow_abbrev=False)
    top = root.add_commands()
    parents = {}
    for command in commands:
        *group, word = command.words
        if group and group[0] not in parents:
            parent = top.add_parser(group[0], help=groups[group[0]], description=groups[group[0]])
            parents[group[0]] = parent.add_commands()
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


def argument_error(reason: Reason) -> argparse.ArgumentTypeError:
    """The error of an argument's type, in the language of the command line."""
    return argparse.ArgumentTypeError(sentence(reason))


def positive_integer(text: str) -> int:
    """An argument's type: an integer above 0."""
    value = int(text)
    if value < 1:
        raise _wrong("cli.parser.not_positive", value=value)
    return value


def comma_hint(text: str) -> Remedy | None:
    """What a number with a comma was likely meant to be; None for a text without one."""
    from gemelo.schemas.reasons import remedy  # 30 ms, where something is refused

    found = _COMMA.fullmatch(text)
    if found is None:
        return None
    before, after, rest = found.groups()
    units = before if before[-1:].isdigit() else f"{before}0"
    if len(after) == 3 and before.lstrip("+-") not in ("", "0"):
        return remedy("decimal_point_or", text=f"{units}.{after}{rest}", other=f"{before}{after}{rest}")
    return remedy("decimal_point", text=f"{units}.{after}{rest}")


def positive_number(text: str) -> float:
    """An argument's type: a finite number above 0, in the unit that the option names."""
    if hint := comma_hint(text):
        raise _wrong("cli.parser.comma", hint, text=text)
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise _wrong("cli.parser.not_positive_finite", text=text)
    return value


def finite_number(text: str) -> float:
    """An argument's type: a finite number without a unit, as of a direction."""
    from gemelo.schemas.reasons import remedy  # 30 ms, where something is refused

    try:
        value = float(text)
    except ValueError:
        raise _wrong("cli.parser.no_direction", comma_hint(text) or remedy("without_unit"), text=text) from None
    if not abs(value) < float("inf"):
        raise _wrong("cli.parser.not_finite", text=text)
    return value


def _wrong(code: str, *hints: Remedy, **values: Value) -> argparse.ArgumentTypeError:
    from gemelo.schemas.reasons import because  # 30 ms, where something is refused

    return argument_error(because(code, *hints, **values))
