"""The threads that take part in virtual time: what each waits for, and how long one at work has slept by itself.

Who computes, or is ready to where the machine has no time for it, does not sleep.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

SLEEPING = ("S", "Z", "X", "T")  # standard: of proc(5); a thread that waits for a disk is in D


class IdleTime:
    """Of one thread, counted from the first question on.

    Linux says how long a thread was on a processor and how long it waited for one (sched-stats.rst), the latter only
    when it has one again; where the system says neither, all of the time counts.
    """

    def __init__(self, thread: threading.Thread) -> None:
        self._thread = thread
        self._began: tuple[float, float] | None = None  # [s] of real time, and busy until then

    def seconds(self) -> float:
        """[s] of real time."""
        folder, now = Path(f"/proc/self/task/{self._thread.native_id}"), time.monotonic()
        try:
            if (folder / "stat").read_text().rpartition(") ")[2][0] not in SLEEPING:
                self._began = None
                return 0.0
            busy = sum(map(int, (folder / "schedstat").read_text().split()[:2])) * 1e-9
        except (OSError, ValueError):
            busy = 0.0
        if self._began is None:
            self._began = now, busy
        return now - self._began[0] - (busy - self._began[1])


@dataclass(eq=False)
class Wait:
    """What one thread waits for, and until when [ns]."""

    is_so: Callable[[], bool]
    end: float


@dataclass(eq=False)
class Participant:
    """A thread that has waited before."""

    thread: threading.Thread
    waits: list[Wait] = field(default_factory=list)  # one within the other, where a handler waits too
    idle: IdleTime | None = None  # since somebody waits for it; None where it waits itself
