"""Ctrl-C in two stages: the first asks for a stop that is awaited, the second leaves."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupt:
    """Whether Ctrl-C has been pressed."""

    def __init__(self) -> None:
        self.is_set = False
        self.is_answered = False  # by whoever was asked to stop

    def press(self) -> None:
        """The first time it is remembered; the second time it raises KeyboardInterrupt."""
        if self.is_set:
            raise KeyboardInterrupt
        self.is_set = True


@contextmanager
def two_stage_interrupt() -> Iterator[Interrupt]:
    """SIGINT goes to the `Interrupt` given, until the block ends."""
    interrupt = Interrupt()

    def on_signal(number: int, frame: FrameType | None) -> None:
        interrupt.press()

    before = signal.signal(signal.SIGINT, on_signal)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
