"""The clock of a process, with all that differs from one run to the next: time, random numbers, its own number.

Everything in `gemelo.libraries.runtime` and `gemelo` takes them from the clock of its bus. `SYSTEM` is that of
every real process; a simulation has one of virtual time, in which the same seed gives the same bytes
(`tools/simulation/virtual_clock.py`).
"""

from __future__ import annotations

import os
import secrets
import socket
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Protocol, TypeVar

T = TypeVar("T")


class Timer(Protocol):
    """A task that is called later, unless it is cancelled before."""

    def cancel(self) -> None: ...


class DrivenLoop(Protocol):
    """An event loop, as a clock sees it that runs loops itself."""

    def due(self) -> float:
        """[s] monotonic of the next thing to do."""
        ...

    def turn(self) -> None:
        """Does what is due now: the step, the periodic tasks, and one queued task."""
        ...

    def on_task(self, wake: Callable[[], None] | None) -> None:
        """`wake` is called after every task that is queued."""
        ...


class Clock(Protocol):
    """Any thread may use it."""

    @property
    def is_virtual(self) -> bool:
        """True if time passes only while somebody waits, and the clock itself runs the loops of the nodes."""
        ...

    def monotonic(self) -> float:
        """[s] for durations."""
        ...

    def unix(self) -> int:
        """[ns] UNIX time, for stamps."""
        ...

    def cpu(self) -> float:
        """[s] of processor time that this process has used."""
        ...

    def sleep(self, seconds: float) -> None: ...

    def look(self) -> None:
        """Somebody looks at what changes by itself: a moment of virtual time, for else a loop would never end."""
        ...

    def later(self, seconds: float, task: Callable[[], None]) -> Timer:
        """`task` is called after `seconds` [s], in another thread or while somebody waits."""
        ...

    def condition(self) -> threading.Condition:
        """A condition whose waits last as long as this clock says."""
        ...

    def take(self, queue: SimpleQueue[T], timeout: float) -> T:
        """The next of a queue; raises `queue.Empty` after `timeout` [s]."""
        ...

    def thread(self, target: Callable[[], object], name: str) -> threading.Thread:
        """A daemon thread, to be started by the caller, in which this clock may be used."""
        ...

    def drive(self, loop: DrivenLoop) -> None:
        """Runs a loop from now on, while others wait; of a virtual clock only."""
        ...

    def release(self, loop: DrivenLoop) -> None:
        """Ends `drive`."""
        ...

    def wait_until(self, is_so: Callable[[], bool], timeout: float | None) -> bool:
        """Waits, and runs the loops meanwhile; False after `timeout` [s]. Of a virtual clock only."""
        ...

    def bits(self, count: int) -> int:
        """So many random bits."""
        ...

    def process(self) -> int:
        """A number that no other living process of this host has."""
        ...

    def host(self) -> str:
        """The name of this computer."""
        ...


def token(clock: Clock, count: int = 128) -> str:
    """So many random bits as hexadecimal digits, for an id that nothing else has."""
    return f"{clock.bits(count):0{count // 4}x}"


class SystemClock:
    """The operating system's."""

    is_virtual = False

    def monotonic(self) -> float:
        return time.monotonic()

    def unix(self) -> int:
        return time.time_ns()

    def cpu(self) -> float:
        return time.process_time()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def look(self) -> None:
        pass

    def later(self, seconds: float, task: Callable[[], None]) -> Timer:
        timer = threading.Timer(seconds, task)
        timer.daemon = True
        timer.start()
        return timer

    def condition(self) -> threading.Condition:
        return threading.Condition()

    def take(self, queue: SimpleQueue[T], timeout: float) -> T:
        return queue.get(timeout=timeout) if timeout > 0.0 else queue.get_nowait()

    def thread(self, target: Callable[[], object], name: str) -> threading.Thread:
        return threading.Thread(target=target, name=name, daemon=True)

    def drive(self, loop: DrivenLoop) -> None:
        raise RuntimeError("only a virtual clock runs loops")

    def release(self, loop: DrivenLoop) -> None:
        raise RuntimeError("only a virtual clock runs loops")

    def wait_until(self, is_so: Callable[[], bool], timeout: float | None) -> bool:
        raise RuntimeError("only a virtual clock runs loops")

    def bits(self, count: int) -> int:
        return secrets.randbits(count)

    def process(self) -> int:
        return os.getpid()

    def host(self) -> str:
        return socket.gethostname()


SYSTEM: Clock = SystemClock()
