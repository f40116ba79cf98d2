"""The event loop: steps at their deadlines, periodic tasks, and between them the queued tasks.

The deadline is looked at before every message, so a flood cannot starve the step; at least one
message is handled after every step, so a slow step cannot starve the queue.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.loop.task_queue import Task, TaskQueue
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest


@dataclass
class LoopFigures:
    """The figures of a loop since the last report."""

    steps: int = 0
    late_max: float = 0.0  # [s]


class Schedule:
    """Deadlines at `start + k / rate`; those that a long step slept through are left out."""

    def __init__(self, rate: float, start: float) -> None:
        """`rate` in [Hz], `start` in [s] monotonic; raises ValueError for a rate of 0 or less."""
        if not rate > 0.0:
            raise ValueError(f"rate {rate} Hz: it must be above 0")
        self._start, self._rate, self._count = start, rate, 0
        self.deadline = start  # [s] of the next step, on the clock of `start`
        self.figures = LoopFigures()

    def begin(self, now: float) -> None:
        """Records how late the step that begins at `now` [s] is."""
        self.figures.steps += 1
        self.figures.late_max = max(self.figures.late_max, now - self.deadline)

    def end(self, now: float) -> None:
        """Advances to the first deadline after `now` [s]."""
        self._count = max(self._count + 1, int((now - self._start) * self._rate) + 1)
        self.deadline = self._start + self._count / self._rate

    def take_figures(self) -> LoopFigures:
        """The figures since the last call."""
        figures, self.figures = self.figures, LoopFigures()
        return figures


IDLE_TIMEOUT = 3600.0  # [s] how long to wait at most where nothing is due
TICK = 0.05  # [s] between two looks of `wait_for`


@dataclass
class PeriodicTask:
    """A task that is due every `period` [s]."""

    period: float
    task: Task
    due: float = 0.0  # [s] monotonic


class Loop:
    """Runs in one thread at a time: by `spin` and `wait`, or turn by turn by a clock of virtual time."""

    def __init__(
        self, stop: ShutdownRequest, clock: Clock = SYSTEM, on_failure: Callable[[Exception], object] | None = None
    ) -> None:
        """`on_failure` takes what a handler or task raises, which ends the loop otherwise; what the step raises does in
        any case."""
        self.clock = clock
        self._on_failure = on_failure
        self.tasks = TaskQueue()
        self._periodic_tasks: list[PeriodicTask] = []
        self._thread: int | None = None
        self._schedule: Schedule | None = None
        self._step: Callable[[int], object] = _nothing
        self._is_driven = False  # by the clock
        self._turn_thread = 0  # in which a turn runs now
        self.stop = stop
        stop.on_set(self.tasks.wake)

    def every(self, period: float, task: Task) -> None:
        """`task` runs every `period` [s] while the loop does."""
        # A new list, because a task may add another one while the old list is iterated.
        self._periodic_tasks = [*self._periodic_tasks, PeriodicTask(period, task)]
        if self._is_driven:
            self.tasks.wake()

    def carry_out(self, work: Callable[..., object], *arguments: object) -> None:
        """Calls `work(*arguments)`: a handler or a task."""
        try:
            work(*arguments)
        except Exception as error:
            if self._on_failure is None:
                raise
            self._on_failure(error)

    def forget(self, task: Task) -> None:
        """Ends an `every`."""
        self._periodic_tasks = [each for each in self._periodic_tasks if each.task != task]

    def take_figures(self) -> LoopFigures:
        """The figures of `spin` since the last call."""
        return self._schedule.take_figures() if self._schedule else LoopFigures()

    def spin(self, step: Callable[[int], object], rate: float) -> None:
        """Calls `step(now [ns UNIX])` at `rate` [Hz] until asked to stop."""
        if self.clock.is_virtual:
            self.begin(step, rate)
            self.clock.wait_until(lambda: self.stop.is_set, None)
            return
        with self._in_this_thread():
            schedule = self._schedule = Schedule(rate, self.clock.monotonic())
            self._step = step
            while not self.stop.is_set:
                now = self.clock.monotonic()
                self._run_once(now, now if self._step_if_due(now) else schedule.deadline)

    def begin(self, step: Callable[[int], object], rate: float) -> None:
        """As `spin` at `rate` [Hz], but the clock, of virtual time, has it run from now on: returns at once."""
        self._schedule, self._step = Schedule(rate, self.clock.monotonic()), step
        self._drive()

    def due(self) -> float:
        """[s] monotonic of the next thing to do; infinite once it was asked to stop."""
        if self.stop.is_set:
            return math.inf
        if not self.tasks.is_empty:
            return self.clock.monotonic()
        due = math.inf if self._schedule is None else self._schedule.deadline
        for periodic in self._periodic_tasks:
            if periodic.due < due:
                due = periodic.due
        return due

    def turn(self) -> None:
        """Does what is due now: the step, the periodic tasks, and one queued task."""
        now, self._turn_thread = self.clock.monotonic(), threading.get_ident()
        try:
            self._step_if_due(now)
            self._run_periodic_tasks(now)
            task = self.tasks.take_at_once()
            if task is not None:
                self.carry_out(task)
        finally:
            self._turn_thread = 0

    @property
    def is_in_turn(self) -> bool:
        """True where this is called in a turn of this loop, by the step or a task."""
        return self._turn_thread == threading.get_ident()

    def on_task(self, wake: Task | None) -> None:
        """`wake` is called after every task that is queued."""
        self.tasks.on_put = wake

    def end(self) -> None:
        """The clock has it run no more."""
        if self._is_driven:
            self._is_driven = False
            self.clock.release(self)

    def _drive(self) -> None:
        if not self._is_driven:
            self._is_driven = True
            self.clock.drive(self)

    def wait(self, seconds: float) -> None:
        """Handles queued tasks for `seconds` [s], or until shutdown is requested."""
        self.wait_for(lambda: False, seconds)

    def wait_for(self, is_done: Callable[[], bool], timeout: float, on_tick: Task | None = None) -> bool:
        """Handles queued tasks until `is_done()`; False after `timeout` [s]. `on_tick` is called 20 times a second.

        While another thread runs the loop, this one only checks `is_done`.
        """
        if self.clock.is_virtual:
            was_driven = self._is_driven
            self._drive()
            try:
                return self._wait_for_clock(is_done, timeout, on_tick)
            finally:
                if not was_driven:
                    self.end()
        end = self.clock.monotonic() + timeout
        if self._thread is not None and self._thread != threading.get_ident():
            return self._wait_for_other_thread(is_done, end, on_tick)
        with self._in_this_thread():
            tick = self.clock.monotonic()
            while not is_done():
                now = self.clock.monotonic()
                if self.stop.is_set or now >= end:
                    return False
                if on_tick is not None and now >= tick:
                    tick = now + TICK
                    on_tick()
                self._run_once(now, min(end, tick) if on_tick is not None else end)
        return True

    def _wait_for_clock(self, is_done: Callable[[], bool], timeout: float, on_tick: Task | None) -> bool:
        end, pause = self.clock.monotonic() + timeout, TICK if on_tick is not None else timeout
        while not is_done():
            left = end - self.clock.monotonic()
            if self.stop.is_set or left <= 0.0:
                return False
            if on_tick is not None:
                on_tick()
            self.clock.wait_until(lambda: is_done() or self.stop.is_set, min(left, pause))
        return True

    def _wait_for_other_thread(self, is_done: Callable[[], bool], end: float, on_tick: Task | None) -> bool:
        while not is_done():
            if self.stop.is_set or self.clock.monotonic() >= end:
                return False
            if on_tick is not None:
                on_tick()
            self.clock.sleep(TICK / 5)
        return True

    def _step_if_due(self, now: float) -> bool:
        """Runs the step if its deadline is there at `now` [s] monotonic; True if it was."""
        if self._schedule is None or now < self._schedule.deadline:
            return False
        self._schedule.begin(now)
        self._step(self.clock.unix())
        self._schedule.end(self.clock.monotonic())
        return True

    def _run_once(self, now: float, until: float) -> None:
        """Runs the periodic tasks that are due, then one queued task; waits for it until `until` [s] monotonic."""
        self._run_periodic_tasks(now)
        due = min((periodic.due for periodic in self._periodic_tasks), default=math.inf)
        task = self.tasks.take(min(until, due, now + IDLE_TIMEOUT) - now)
        if task is not None:
            self.carry_out(task)

    def _run_periodic_tasks(self, now: float) -> None:
        for periodic in self._periodic_tasks:
            if now >= periodic.due:
                periodic.due = now + periodic.period
                self.carry_out(periodic.task)

    @contextmanager
    def _in_this_thread(self) -> Iterator[None]:
        if self._thread is not None:
            raise RuntimeError("the loop runs already: spin and wait cannot be called from a callback")
        self._thread = threading.get_ident()
        try:
            yield
        finally:
            self._thread = None


def _nothing(_now: int) -> None:
    pass
