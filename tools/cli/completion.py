"""`gemelo completion`: a completion script for bash (zsh takes it after `autoload bashcompinit && bashcompinit`)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from gemelo.tools.cli.commands import COMMANDS
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import load_robot
from gemelo.tools.cli.parser import Command, Options, Parser, complete

if TYPE_CHECKING:
    from gemelo import Robot

_SCRIPT = """_gemelo() {{
    local here=${{COMP_WORDS[COMP_CWORD]}} words
    case "${{COMP_WORDS[*]:1:COMP_CWORD-1}}" in
{cases}
        *) words= ;;
    esac
    COMPREPLY=($(compgen -W "$words" -- "$here"))
    [ -n "$words" ] || COMPREPLY=($(compgen -f -- "$here"))
}}
complete -F _gemelo gemelo
"""


def run(options: Options) -> ExitCode:
    """Prints the script for the deployment's robot."""
    print(script(COMMANDS, robot_if_readable()), end="")
    return ExitCode.OK


def robot_if_readable() -> Robot | None:
    """The deployment's robot; None if its files cannot be read, which no shell should complain of at its start."""
    try:
        return load_robot()
    except CommandError:
        return None


def script(commands: Iterable[Command], robot: Robot | None) -> str:
    """Completes commands, groups and options, and the names that each command's `choices` know."""
    commands = list(commands)
    following: dict[str, list[str]] = {"": []}
    for command in commands:
        for depth, word in enumerate(command.words):
            before = " ".join(command.words[:depth])
            known = following.setdefault(before, [])
            if word not in known:
                known.append(word)
        own = " ".join(command.words)
        following[own] = options_of(command)
        for given, words in choices_of(command, robot).items():
            following.setdefault(f"{own} {given}".strip(), []).extend(words)
    # The longest first: `topic list` must not be taken for `topic` and a word that follows.
    cases = [f'        "{before}") words="{" ".join(words)}" ;;' for before, words in following.items()]
    more = [f'        "{" ".join(c.words)} "*) words="{" ".join(options_of(c))}" ;;' for c in commands if options_of(c)]
    return _SCRIPT.format(cases="\n".join([*cases, *more]))


def options_of(command: Command) -> list[str]:
    """The long options of a command."""
    parser = Parser(add_help=False)
    complete(parser, command)
    return [word for word in parser._option_string_actions if word.startswith("--")]


def choices_of(command: Command, robot: Robot | None) -> dict[str, list[str]]:
    """The words that may follow a command, by its arguments so far."""
    if not command.choices:
        return {}
    return {given: list(words) for given, words in command.load("choices")(robot).items()}
