"""How a command ends: exit codes, and the one exception that carries a sentence and a code to `main`."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """What the shell is told."""

    OK = 0
    FAILED = 1  # refused or aborted: the sentence says why
    USAGE = 2
    NO_STACK = 3  # no router, or nobody who answers
    CANCELLED = 130  # by Ctrl-C


class CommandError(Exception):
    """A command that ends here: one sentence for a person, one code for the shell."""

    def __init__(self, message: str, code: ExitCode = ExitCode.FAILED) -> None:
        super().__init__(message)
        self.code = code


def usage(message: str) -> CommandError:
    """The error of a command line that cannot be understood."""
    return CommandError(message, ExitCode.USAGE)
