"""A block of lines that is drawn again in its place on a terminal, with lines that stay above it."""

from __future__ import annotations

import shutil
import sys

UP_AND_CLEAR = "\x1b[{}F\x1b[J"


class LiveBlock:
    """In a pipe only the lines that stay are printed."""

    def __init__(self, is_live: bool | None = None) -> None:
        self.is_live = sys.stdout.isatty() if is_live is None else is_live
        self._height = 0

    def say(self, *lines: str) -> None:
        """Lines that stay."""
        self._clear()
        if lines:
            print("\n".join(lines), flush=True)

    def draw(self, text: str) -> None:
        """The block as it is now."""
        if not self.is_live:
            return
        columns, lines = shutil.get_terminal_size()
        # A line that wraps, or a block that scrolls, could not be drawn over.
        shown = [line[: columns - 1] for line in text.splitlines()[: lines - 1]]
        self._clear()
        print("\n".join(shown), flush=True)
        self._height = len(shown)

    def _clear(self) -> None:
        if self._height:
            print(UP_AND_CLEAR.format(self._height), end="", flush=True)
            self._height = 0
