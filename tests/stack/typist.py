"""A person at the keyboard of `gemelo jog`: a pseudo-terminal, keys held as a terminal repeats them, what is shown."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import termios
import time
from collections.abc import Callable

from gemelo.tools.stack.stack import Stack
from tests.stack.gemelo import COMMAND

REPEAT = 0.03  # [s] between two of a key that is held
LONGEST_HOLD = 30.0  # [s]
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Typist:
    """Types at a command that has the terminal for itself; entering waits until it takes keys.

    `pause` passes the time [s] between two looks: it may do something meanwhile.
    """

    def __init__(self, stack: Stack, *words: str, pause: Callable[[float], None] = time.sleep) -> None:
        self._pause = pause
        self._outer, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self._shown = ""
        self.command = subprocess.Popen(
            ["setsid", "--ctty", *COMMAND, *words],
            cwd=stack.root, env={**stack.environment, "TERM": "xterm", "COLUMNS": "200", "LINES": "40"},
            stdin=self.terminal, stdout=self.terminal, stderr=self.terminal,
        )  # fmt: skip

    def __enter__(self) -> Typist:
        assert self.until("leave", 20.0), self.shown
        return self

    def __exit__(self, *_: object) -> None:
        if self.command.poll() is None:
            self.command.kill()
            self.command.wait()
        os.close(self._outer)
        os.close(self.terminal)

    @property
    def shown(self) -> str:
        """All that came to the screen, without its escapes."""
        while select.select([self._outer], [], [], 0.0)[0]:
            self._shown += os.read(self._outer, 65536).decode("utf-8", "replace")
        return ESCAPES.sub("", self._shown)

    def forget(self) -> None:
        """Only what comes from now on is looked at."""
        _ = self.shown
        self._shown = ""

    def type(self, keys: str) -> None:
        os.write(self._outer, keys.encode())

    def hold(self, key: str, seconds: float) -> float:
        """Until so many seconds are over; the moment [s, monotonic] of its last repetition."""
        end = time.monotonic() + seconds
        return self.hold_while(key, lambda: time.monotonic() < end)

    def hold_while(self, key: str, is_held: Callable[[], bool]) -> float:
        """For as long as that is true, but not for ever; the same moment."""
        end, last = time.monotonic() + LONGEST_HOLD, 0.0
        while is_held():
            assert time.monotonic() < end, self.shown[-2000:]
            self.type(key)
            last = time.monotonic()
            _ = self.shown  # a terminal that nobody reads would block the command
            self._pause(REPEAT)
        return last

    def until(self, text: str, timeout: float) -> bool:
        """Whether `text` came to the screen in time."""
        end = time.monotonic() + timeout
        while text not in self.shown:
            if time.monotonic() > end:
                return False
            self._pause(REPEAT)
        return True

    def ended(self, timeout: float = 15.0) -> int:
        """The exit code."""
        end = time.monotonic() + timeout
        while self.command.poll() is None and time.monotonic() < end:
            _ = self.shown
            self._pause(REPEAT)
        return self.command.wait(0.1)

    @property
    def terminal_is_as_before(self) -> bool:
        return termios.tcgetattr(self.terminal) == self.before
