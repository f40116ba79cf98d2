"""Words for the shell: a bash script (zsh takes it after `autoload bashcompinit && bashcompinit`)."""

from __future__ import annotations

from collections.abc import Iterable

from services.cli.parser import Command, Parser

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


def script(commands: Iterable[Command]) -> str:
    """Completes commands, groups and options; topics and actions by their table, the arm's parts by robot.toml."""
    commands = list(commands)
    following: dict[str, list[str]] = {"": []}
    for command in commands:
        for depth, word in enumerate(command.words):
            before = " ".join(command.words[:depth])
            known = following.setdefault(before, [])
            if word not in known:
                known.append(word)
        own = " ".join(command.words)
        following[own] = [*arguments_of(command), *options_of(command)]
        for given, words in command.words_after().items():
            following.setdefault(f"{own} {given}".strip(), []).extend(words)
    # The longest first: `topic list` must not be taken for `topic` and a word that follows.
    cases = [f'        "{before}") words="{" ".join(words)}" ;;' for before, words in following.items()]
    more = [f'        "{" ".join(c.words)} "*) words="{" ".join(options_of(c))}" ;;' for c in commands if options_of(c)]
    return _SCRIPT.format(cases="\n".join([*cases, *more]))


def options_of(command: Command) -> list[str]:
    """The long options of a command."""
    parser = Parser(add_help=False)
    command.add_options(parser)
    return [word for word in parser._option_string_actions if word.startswith("--")]


def arguments_of(command: Command) -> list[str]:
    """What its first argument can be, where a table says so."""
    from schemas.topics import ACTIONS, REQUESTS, TOPICS

    if len(command.words) < 2 or command.words[1] == "list":
        return []
    tables = {"topic": TOPICS, "request": REQUESTS, "action": ACTIONS}
    return [row.key for row in tables.get(command.words[0], ())]  # type: ignore[attr-defined]
