"""Exit codes, the exception that ends a command with one sentence, and suggestions for mistyped names."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum


class ExitCode(IntEnum):
    """The exit code of the process."""

    OK = 0
    FAILED = 1  # refused or aborted: the sentence says why
    USAGE = 2
    NO_STACK = 3  # no router, or nobody who answers
    CANCELLED = 130  # by Ctrl-C


class CommandError(Exception):
    """Ends a command: one sentence for a person, one exit code for the shell."""

    def __init__(self, message: str, code: ExitCode = ExitCode.FAILED) -> None:
        super().__init__(message)
        self.code = code


def usage(message: str) -> CommandError:
    """The error of a command line that cannot be understood; exit code 2."""
    return CommandError(message, ExitCode.USAGE)


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most similar to `name`; None if none is similar."""
    from difflib import get_close_matches

    known = list(known)
    close = get_close_matches(name, known, n=1, cutoff=0.5)
    if close:
        return close[0]
    inside = [candidate for candidate in known if name and name in candidate]
    return inside[0] if inside else None


def unknown(kind: str, name: str, known: Iterable[str]) -> CommandError:
    """`no topic "joint_state": did you mean "joint_states"?`, or the list of all known names."""
    known = sorted(known)
    guess = nearest(name, known)
    if guess is not None:
        return usage(f'no {kind} "{name}": did you mean "{guess}"?')
    return usage(f'no {kind} "{name}": there is {", ".join(known) if known else "none at all"}')
