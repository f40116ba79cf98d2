"""SIGTERM and SIGHUP as what Ctrl-C is: a program that has something to end or to give back ends it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = (signal.SIGTERM, signal.SIGHUP)  # `kill`, and a terminal that is closed


class EndedBySignal(KeyboardInterrupt):
    """SIGTERM or SIGHUP."""


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """SIGTERM and SIGHUP raise `EndedBySignal` in the main thread, until the end of the block."""

    def end(number: int, frame: FrameType | None) -> None:
        raise EndedBySignal

    before = {number: signal.signal(number, end) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
