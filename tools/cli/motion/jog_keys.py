"""The keys of `gemelo jog`: read one by one from the terminal and turned into jog commands.

A key counts as held while the terminal repeats it.
"""

from __future__ import annotations

import os
import re
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Protocol

from gemelo.schemas.planning import JogCommand
from gemelo.schemas.reasons import because, remedy
from gemelo.tools.cli.common.errors import usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.units import NamedJoint

HELD = 0.15  # [s] after which a key that does not repeat has been let go
FASTER = 1.25
SLOWEST = 0.01
FIRST_SPEED = 0.2
TOOL_SPEED = 0.25  # [m/s] at full speed
TURN_SPEED = 1.0  # [rad/s] at full speed
AXES = {"w": (0, 1.0), "s": (0, -1.0), "a": (1, 1.0), "d": (1, -1.0), "q": (2, 1.0), "e": (2, -1.0)}
TURNS = {"i": (0, 1.0), "k": (0, -1.0), "j": (1, 1.0), "l": (1, -1.0), "u": (2, 1.0), "o": (2, -1.0)}
ARROWS = {"\x1b[A": 1.0, "\x1b[C": 1.0, "\x1b[B": -1.0, "\x1b[D": -1.0}
BYTES_AT_ONCE = 256
LEAVE = ("x", "\x1b", "\x03", "\x04")

_KEYS = re.compile(r"\x1b[\[O][A-Z]|\x1b\[[0-9;]*[~A-Za-z]|.", re.DOTALL)


class SpeedyJoint(NamedJoint, Protocol):
    """A joint with its velocity limit [rad/s] or [m/s]."""

    @property
    def velocity(self) -> float:
        """Velocity limit [rad/s] or [m/s]."""


class JogKeys:
    """Turns keys into the command that holds now; times are [s] of one clock."""

    def __init__(self, joints: Sequence[SpeedyJoint], tool_frame: str) -> None:
        self._joints, self._tool_frame = joints, tool_frame
        self._motion: JogCommand | None = None
        self._pressed = -1.0e9
        self.speed = FIRST_SPEED  # share of the limits
        self.joint = 0
        self.frame = ""
        self.wants_to_leave = False

    def press(self, text: str, now: float) -> None:
        """Takes the terminal's input at `now` [s], perhaps several keys; the last one counts."""
        for key in _KEYS.findall(text):
            self._press("\x1b[" + key[2] if key.startswith("\x1bO") else key, now)

    def command(self, now: float) -> JogCommand | None:
        """The command to send at `now` [s]; None if no key is held."""
        return self._motion if now - self._pressed <= HELD else None

    @property
    def line(self) -> str:
        """The present speed, axes and joint as a line."""
        code = "cli.jog.keys.tool" if self.frame else "cli.jog.keys.base"
        return sentence(because(code, speed=self.speed, number=self.joint + 1, joint=self._joints[self.joint].name))

    def _press(self, key: str, now: float) -> None:
        self._motion = None
        if key in LEAVE:
            self.wants_to_leave = True
        elif key in "+=":
            self.speed = min(1.0, self.speed * FASTER)
        elif key in "-_":
            self.speed = max(SLOWEST, self.speed / FASTER)
        elif key == "t":
            self.frame = "" if self.frame else self._tool_frame
        elif key.isdigit() and 1 <= int(key) <= len(self._joints):
            self.joint = int(key) - 1
        else:
            self._motion, self._pressed = self._moving(key.lower() if len(key) == 1 else key), now

    def _moving(self, key: str) -> JogCommand | None:
        """The motion of a key; None, which is a stop, for any other key."""
        if key in AXES:
            return JogCommand(linear=_along(*AXES[key], self.speed * TOOL_SPEED), frame=self.frame)
        if key in TURNS:
            return JogCommand(angular=_along(*TURNS[key], self.speed * TURN_SPEED), frame=self.frame)
        if key in ARROWS:
            joint = self._joints[self.joint]
            return JogCommand(name=(joint.name,), velocity=(ARROWS[key] * self.speed * joint.velocity,))
        return None


def _along(axis: int, sign: float, speed: float) -> tuple[float, ...]:
    return tuple(sign * speed if index == axis else 0.0 for index in range(3))


def require_terminal(instead: str) -> None:
    """Raises `CommandError` if standard input is no terminal; `instead` is the code of the remedy."""
    if not sys.stdin.isatty():
        raise usage(because("cli.no_terminal", remedy(instead)))


@contextmanager
def keyboard() -> Iterator[Callable[[float], str]]:
    """Yields a function that returns the keys typed since its last call, and waits for the first at most so long [s].

    Restores the terminal whatever happens.
    """
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    signals = {number: signal.signal(number, _raise_interrupt) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        tty.setcbreak(descriptor)
        yield lambda timeout: _typed(descriptor, timeout)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
        for number, handler in signals.items():
            signal.signal(number, handler)


def _typed(descriptor: int, timeout: float) -> str:
    if not select.select([descriptor], [], [], timeout)[0]:
        return ""
    read = os.read(descriptor, BYTES_AT_ONCE)
    return read.decode("utf-8", "ignore") if read else "\x04"  # the terminal is gone


def _raise_interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
