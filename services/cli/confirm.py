"""A question before something that costs work to undo."""

from __future__ import annotations

import sys

from services.cli.exits import CommandError, ExitCode, usage


def confirm(question: str, is_answered: bool) -> None:
    """Returns when the person says yes, or has said so already with --yes; raises otherwise."""
    if is_answered:
        return
    if not sys.stdin.isatty():
        raise usage(f"{question} There is nobody to ask: say --yes")
    print(f"{question} [y/N] ", end="", flush=True)
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise CommandError("nothing was done", ExitCode.CANCELLED)
