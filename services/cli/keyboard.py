"""Keys one by one from a terminal, which is as it was afterwards whatever happens."""

from __future__ import annotations

import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from services.cli.exits import usage

AT_ONCE = 256  # bytes


def require_terminal(remedy: str) -> None:
    """Raises the error of a command that needs keys, with what to do instead."""
    if not sys.stdin.isatty():
        raise usage(f"there is no terminal to read keys from: {remedy}")


@contextmanager
def keyboard() -> Iterator[Callable[[], str]]:
    """Gives a function that returns what was typed since the last call."""
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    signals = {number: signal.signal(number, _leave) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        tty.setcbreak(descriptor)
        yield lambda: _typed(descriptor)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
        for number, handler in signals.items():
            signal.signal(number, handler)


def _typed(descriptor: int) -> str:
    if not select.select([descriptor], [], [], 0.0)[0]:
        return ""
    read = os.read(descriptor, AT_ONCE)
    return read.decode("utf-8", "ignore") if read else "\x04"  # the terminal is gone


def _leave(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
