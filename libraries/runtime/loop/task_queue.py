"""The task queue of a node: threads of the bus put tasks in, the event loop takes them out.

All queues are bounded: a LATEST queue holds one message, an EVERY queue a fixed number, and every
message that does not fit is counted.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Protocol

from gemelo.libraries.runtime.bus.interface import Arrival
from gemelo.libraries.runtime.clock import SYSTEM, Clock

EVERY_CAPACITY = 4096  # messages
GAPS = 3  # that are remembered; chosen: one message that came early or late changes nothing
EVERY_BYTES = 96 * 1024 * 1024  # chosen: two of the largest messages (bus/wire.py) fit

Task = Callable[[], None]


@dataclass(frozen=True, slots=True)
class Arrived:
    """An arrival, and when it came."""

    arrival: Arrival
    at: float  # [s] monotonic
    at_unix: int  # [ns]


class TaskQueue:
    """A FIFO queue of tasks for the event loop, one with priority, and one before both."""

    def __init__(self) -> None:
        self._tasks: SimpleQueue[Task] = SimpleQueue()
        self._before_all: deque[Task] = deque()
        self._urgent: deque[Task] = deque()
        self.on_put: Task | None = None  # called after every `put`

    @property
    def is_empty(self) -> bool:
        return not self._before_all and not self._urgent and self._tasks.empty()

    def put(self, task: Task) -> None:
        self._tasks.put(task)
        if self.on_put is not None:
            self.on_put()

    def put_first(self, task: Task) -> None:
        """`task` is taken before all that `put` has brought."""
        self._urgent.append(task)
        self.wake()

    def put_before_all(self, task: Task) -> None:
        """`task` is taken before what `put_first` has brought too."""
        self._before_all.append(task)
        self.wake()

    def wake(self) -> None:
        """Lets `take` return; safe in a signal handler."""
        self.put(_nothing)

    def take(self, timeout: float) -> Task | None:
        """The next task, or None after `timeout` [s]."""
        if self._before_all or self._urgent or timeout <= 0.0:
            return self.take_at_once()
        try:
            return self._tasks.get(timeout=timeout)
        except Empty:
            return None

    def take_at_once(self) -> Task | None:
        """The next task, or None where there is none."""
        if self._before_all:
            return self._before_all.popleft()
        if self._urgent:
            return self._urgent.popleft()
        return None if self._tasks.empty() else self._tasks.get_nowait()


class ArrivalQueue(Protocol):
    """The queue of the arrivals of one key."""

    dropped: int

    def on_arrival(self, arrival: Arrival) -> None: ...

    def on_miss(self, count: int) -> None: ...


class LatestQueue:
    """A queue of length one: a newer arrival replaces the older one."""

    def __init__(self, tasks: TaskQueue, handle: Callable[[Arrival], None]) -> None:
        self._tasks, self._handle = tasks, handle
        self._lock = threading.Lock()
        self._waiting: Arrival | None = None
        self.dropped = 0

    def on_arrival(self, arrival: Arrival) -> None:
        with self._lock:
            replaces = self._waiting is not None
            self._waiting = arrival
            self.dropped += replaces
        if not replaces:
            self._tasks.put(self._deliver)

    def on_miss(self, count: int) -> None:
        self.dropped += count

    def _deliver(self) -> None:
        with self._lock:
            arrival, self._waiting = self._waiting, None
        if arrival is not None:
            self._handle(arrival)


class EveryQueue:
    """A bounded FIFO queue: an arrival that does not fit is dropped and counted.

    Each has a task of its own in the task queue; without a queue they are handled together by `deliver_all`.
    """

    def __init__(self, tasks: TaskQueue | None, handle: Callable[[Arrival], None]) -> None:
        self._tasks, self._handle = tasks, handle
        self._lock = threading.Lock()
        self._waiting: deque[Arrival] = deque()
        self._bytes = 0
        self.dropped = 0

    def on_arrival(self, arrival: Arrival) -> None:
        with self._lock:
            size = len(arrival.payload)
            if len(self._waiting) >= EVERY_CAPACITY or self._bytes + size > EVERY_BYTES:
                self.dropped += 1
                return
            self._waiting.append(arrival)
            self._bytes += size
        if self._tasks is not None:
            self._tasks.put(self._deliver)

    def on_miss(self, count: int) -> None:
        with self._lock:
            self.dropped += count

    def deliver_all(self) -> None:
        """Handles all that wait, in order."""
        with self._lock:
            waiting, self._waiting = self._waiting, deque()
            self._bytes = 0
        for arrival in waiting:
            self._handle(arrival)

    def _deliver(self) -> None:
        with self._lock:
            arrival = self._waiting.popleft()
            self._bytes -= len(arrival.payload)
        self._handle(arrival)


class Gaps:
    """The times between the last arrivals of one topic."""

    def __init__(self) -> None:
        self._gaps: deque[float] = deque(maxlen=GAPS)  # [s]
        self._arrived: float | None = None  # [s] monotonic

    def on_arrival(self, at: float) -> None:
        """`at` [s] monotonic."""
        if self._arrived is not None:
            self._gaps.append(at - self._arrived)
        self._arrived = at

    def longest(self, otherwise: float) -> float:
        """[s]; `otherwise` before the second arrival."""
        return max(tuple(self._gaps), default=otherwise)


class UnreadQueue:
    """The newest arrival, until somebody takes it: nobody is woken for it, and older ones are never decoded."""

    def __init__(self, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._waiting: Arrived | None = None
        self.gaps = Gaps()
        self.dropped = 0
        self.passed_over = 0  # arrivals that nobody has looked at

    def on_arrival(self, arrival: Arrival) -> None:
        arrived = Arrived(arrival, self._clock.monotonic(), self._clock.unix())
        with self._lock:
            self.gaps.on_arrival(arrived.at)
            self.passed_over += self._waiting is not None
            self._waiting = arrived

    def on_miss(self, count: int) -> None:
        self.dropped += count

    def take(self) -> Arrived | None:
        """The newest, once."""
        if self._waiting is None:
            return None
        with self._lock:
            arrived, self._waiting = self._waiting, None
        return arrived


def _nothing() -> None:
    pass


class Worker:
    """Runs tasks in order, in a thread that starts with the first; in virtual time at once, in the caller's."""

    def __init__(self, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self._tasks: SimpleQueue[Task | None] = SimpleQueue()
        self._thread: threading.Thread | None = None

    def put(self, task: Task) -> None:
        if self._clock.is_virtual:
            return task()
        self._tasks.put(task)
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, daemon=True, name="worker")
            self._thread.start()

    def close(self) -> None:
        """Ends after the present task; does not wait for it."""
        self._tasks.put(None)

    def _run(self) -> None:
        while (task := self._tasks.get()) is not None:
            task()
