"""A board of somebody else's at the other end of a real pseudo-terminal: it answers every line, as it is told to."""

from __future__ import annotations

import os
import re
import select
import termios
import threading
import time
import tty
from collections.abc import Callable

LINE = re.compile(rb"<(\d+),([-+0-9.,]+)>\n")
Answering = Callable[[int, bytes], list[bytes]]  # number and answer of a line, to what is written


class PtyBoard:
    """Keeps the positions that it was sent last; `answering` may lose, double or hold back an answer."""

    def __init__(self, answering: Answering = lambda _, answer: [answer]) -> None:
        self._end, other = os.openpty()
        tty.setraw(other)
        self.path, self._other = os.ttyname(other), other
        self.answering = answering
        self.lines: list[tuple[int, tuple[float, ...]]] = []
        self._booted = time.monotonic()
        self._running = True
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def position(self) -> tuple[float, ...]:
        """[rad] or [m] that the newest line said."""
        return self.lines[-1][1]

    @property
    def speed(self) -> int:
        """The code of the baud rate that the other end has set, of termios."""
        speed: int = termios.tcgetattr(self._other)[5]
        return speed

    def write(self, data: bytes) -> None:
        os.write(self._end, data)

    def close(self) -> None:
        self._running = False
        self._thread.join()
        os.close(self._end)
        os.close(self._other)

    def _run(self) -> None:
        rest = b""
        while self._running:
            if not select.select([self._end], [], [], 0.02)[0]:
                continue
            rest += os.read(self._end, 4096)
            while (match := LINE.search(rest)) is not None:
                rest = rest[match.end() :]
                self._on_line(int(match[1]), tuple(float(number) for number in match[2].split(b",")))

    def _on_line(self, seq: int, position: tuple[float, ...]) -> None:
        self.lines.append((seq, position))
        stamp = int((time.monotonic() - self._booted) * 1e6)
        for payload in self.answering(seq, f"<ACK,{seq},{stamp}>\n".encode()):
            self.write(payload)
