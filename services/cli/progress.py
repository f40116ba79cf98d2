"""How a motion is shown while it runs: a bar on a terminal, a line now and then in a pipe, nothing with --json."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Show = Callable[[float, float], None]  # elapsed [s], duration [s]
PLAIN_EVERY = 0.25  # of the whole motion


@contextmanager
def progress(duration: float, quiet: bool = False) -> Iterator[Show]:
    """Gives the function to call with elapsed and whole time [s]."""
    if quiet:
        yield lambda elapsed, whole: None
    elif sys.stdout.isatty():
        with _bar(duration) as show:
            yield show
    else:
        yield PlainProgress()


@contextmanager
def _bar(duration: float) -> Iterator[Show]:
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("moving"), BarColumn(40), TextColumn("{task.completed:.1f} of {task.total:.1f} s"))
    with Progress(*columns, transient=True) as bar:
        task = bar.add_task("move", total=duration)
        yield lambda elapsed, whole: bar.update(task, completed=min(elapsed, whole), total=whole)


class PlainProgress:
    """A line at every quarter of the way."""

    def __init__(self) -> None:
        self._next = PLAIN_EVERY

    def __call__(self, elapsed: float, whole: float) -> None:
        share = elapsed / whole if whole > 0.0 else 1.0
        if share < self._next or share >= 1.0:
            return
        self._next = (share // PLAIN_EVERY + 1.0) * PLAIN_EVERY
        print(f"moving: {share * 100.0:.0f} %, {elapsed:.1f} of {whole:.1f} s", flush=True)
