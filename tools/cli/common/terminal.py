"""The terminal: lines redrawn in place, the progress of a motion, yes-or-no questions, and Ctrl-C in two stages."""

from __future__ import annotations

import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from gemelo.schemas.plain_text import COLOUR
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.output import control, print_coloured, unescaped

UP_AND_CLEAR = "\x1b[{}F\x1b[J"
PLAIN_EVERY = 0.25  # of the whole motion
CANCELLING = because("cli.cancelling")
ShowProgress = Callable[[float, float], None]  # elapsed [s], duration [s]


class LiveBlock:
    """Lines that are redrawn in place on a terminal, below lines that stay; in a pipe only the latter are printed."""

    def __init__(self, is_live: bool | None = None) -> None:
        self.is_live = sys.stdout.isatty() if is_live is None else is_live
        self._height = 0

    def say(self, *lines: str, is_coloured: bool = False) -> None:
        """Prints lines that stay, and removes the block until it is drawn again."""
        self._clear()
        if lines:
            _print("\n".join(lines), is_coloured)

    def draw(self, text: str, is_coloured: bool = False) -> None:
        """Replaces the block by `text`; prints nothing in a pipe."""
        if not self.is_live:
            return
        columns, lines = shutil.get_terminal_size()
        # A line that wraps, or a block that scrolls, could not be drawn over.
        shown = [cut(line, columns - 1) for line in text.splitlines()[: lines - 1]]
        self._clear()
        _print("\n".join(shown), is_coloured)
        self._height = len(shown)

    def _clear(self) -> None:
        if self._height:
            control(UP_AND_CLEAR.format(self._height))
            self._height = 0


def _print(text: str, is_coloured: bool) -> None:
    if is_coloured:
        print_coloured(text)
    else:
        print(text, flush=True)


def cut(line: str, columns: int) -> str:
    """The first `columns` characters of a line; its colours take no room, and all of them are kept."""
    parts, room = [], columns
    for index, part in enumerate(COLOUR.split(line)):
        if index % 2:
            parts.append(part)
        else:
            parts.append(part[: max(room, 0)])
            room -= len(part)
    return "".join(parts)


@contextmanager
def motion_progress(duration: float, quiet: bool = False) -> Iterator[ShowProgress]:
    """Yields the function to call with elapsed and total time [s]: a bar on a terminal, a line now and then in a pipe.

    `duration` [s] is the planned one; nothing is printed if `quiet`.
    """
    if quiet:
        yield lambda elapsed, whole: None
    elif sys.stdout.isatty():
        with _bar(duration) as show:
            yield show
    else:
        yield _PlainProgress()


@contextmanager
def _bar(duration: float) -> Iterator[ShowProgress]:
    from rich.console import Console  # slow to load, for a terminal alone
    from rich.progress import BarColumn, Progress, TextColumn

    moving, of = sentence(because("cli.moving")), sentence(because("cli.of"))
    times = TextColumn(f"{{task.completed:.1f}} {of} {{task.total:.1f}} s")
    columns = (TextColumn(moving), BarColumn(40), times)
    with Progress(*columns, console=Console(file=unescaped(sys.stdout)), transient=True) as bar:
        task = bar.add_task("move", total=duration)
        yield lambda elapsed, whole: bar.update(task, completed=min(elapsed, whole), total=whole)


class _PlainProgress:
    """Prints a line at every quarter of the duration."""

    def __init__(self) -> None:
        self._next = PLAIN_EVERY

    def __call__(self, elapsed: float, whole: float) -> None:
        share = elapsed / whole if whole > 0.0 else 1.0
        if share < self._next or share >= 1.0:
            return
        self._next = (share // PLAIN_EVERY + 1.0) * PLAIN_EVERY
        print(sentence(because("cli.moved", share=share, elapsed=elapsed, whole=whole)), flush=True)


def confirm(question: Reason, is_answered: bool) -> None:
    """Returns if the person says yes, or `is_answered` by --yes; raises `CommandError` otherwise."""
    if is_answered:
        return
    if not sys.stdin.isatty():
        raise usage(because("cli.nobody_to_ask", question))
    print(f"{sentence(because('cli.ask', question))} ", end="", flush=True)
    if sys.stdin.readline().strip().lower() not in sentence(because("cli.ask.yes")).split():
        raise CommandError(because("cli.nothing_done"), ExitCode.CANCELLED)


class Interrupt:
    """The state of Ctrl-C: the first press asks for a stop that is awaited, the second one leaves."""

    def __init__(self) -> None:
        self.is_set = False
        self.is_answered = False  # by whoever was asked to stop

    def press(self) -> None:
        """Remembers the first press; raises KeyboardInterrupt at the second."""
        if self.is_set:
            raise KeyboardInterrupt
        self.is_set = True


@contextmanager
def two_stage_interrupt() -> Iterator[Interrupt]:
    """Directs SIGINT to the `Interrupt` that it yields, until the block ends."""
    interrupt = Interrupt()

    def on_signal(number: int, frame: FrameType | None) -> None:
        interrupt.press()

    before = signal.signal(signal.SIGINT, on_signal)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
