"""Output of every command: what it prints has no control characters of others, by which a terminal would be led."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from gemelo.schemas.plain_text import escaped, escaped_but_colours


class EscapedStream:
    """A stream that writes no control character, whoever prints: names, logs and messages are others' text."""

    def __init__(self, unescaped: TextIO) -> None:
        self.unescaped = unescaped

    def write(self, text: str) -> int:
        """The number of characters that were given."""
        self.unescaped.write(escaped(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.unescaped, name)


@contextmanager
def escaped_output() -> Iterator[None]:
    """Whatever is printed meanwhile, on stdout or stderr, is escaped; `control` alone writes past it."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, EscapedStream(unescaped(each))) for each in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def unescaped(stream: TextIO) -> TextIO:
    """The stream itself, for what writes sequences of its own, as a bar of progress."""
    return stream.unescaped if isinstance(stream, EscapedStream) else stream


def control(sequence: str, stream: TextIO | None = None) -> None:
    """Writes a sequence of our own, which moves the cursor or clears, to stdout or `stream`."""
    print(sequence, end="", file=unescaped(stream or sys.stdout), flush=True)


def print_coloured(text: str) -> None:
    """Prints a drawing of ours with its colours; every other control character is escaped."""
    print(escaped_but_colours(text), file=unescaped(sys.stdout), flush=True)
