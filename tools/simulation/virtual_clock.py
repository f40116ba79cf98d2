"""Virtual time: it passes only while somebody waits, as fast as the machine computes.

Everything that happens is an event with a time: a turn of a node's loop, or a timer. Whoever waits runs one event after
another, in the order of their times, until what he waits for is there. Several threads may wait at once; one runs at a
time, so that the same seed gives the same bytes, and time stands still while one of them is at work, or would be if the
machine let it. A thread that has slept for `GRACE` of real time (it waits for something else) is waited for no longer.
"""

from __future__ import annotations

import heapq
import itertools
import math
import random
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from types import FrameType
from typing import TypeVar

from gemelo.libraries.runtime.clock import DrivenLoop
from gemelo.tools.simulation.baton import Baton, VirtualCondition
from gemelo.tools.simulation.participants import IdleTime, Participant, Wait

T = TypeVar("T")

UNIX = 1_700_000_000_000_000_000  # [ns] at the start of virtual time
ZERO = 1000.0  # [s] of the monotonic clock at the start
LOOK = 1_000_000  # [ns] that it takes to look at what changes by itself
AT_ONCE = 16  # turns of one loop to which nothing else comes in between, where it has so much to do
GRACE = 0.25  # [s] of real time
BLINK = 0.05  # [s] of real time at most between two looks whether Ctrl-C was pressed


class VirtualTimer:
    """A task that is called later."""

    def __init__(self, task: Callable[[], None]) -> None:
        self.task: Callable[[], None] | None = task

    def cancel(self) -> None:
        self.task = None


@dataclass(eq=False)
class LoopTurns:
    """One loop, and when its next turn is [ns]; None while none is planned."""

    loop: DrivenLoop
    at: int | None = None
    is_busy: bool = False  # in a turn


class VirtualClock:
    """The clock of one simulation; see `gemelo.libraries.runtime.clock.Clock`."""

    is_virtual = True

    def __init__(self, seed: int = 1, time_scale: float | None = None) -> None:
        """`time_scale`: virtual seconds in a real one; None is as fast as can be. Raises ValueError for 0 or less."""
        if time_scale is not None and not 0.0 < time_scale < math.inf:
            raise ValueError(f"time_scale={time_scale}: it must be above 0; 1.0 is real time, None as fast as can be")
        self.now = 0  # [ns] since the start
        self._scale: float | None = None
        self._asked_scale = time_scale
        self._anchor = (0.0, 0)  # real time [s] and virtual time [ns] at the same moment
        self._random = random.Random(seed)
        self._processes = itertools.count(1001)
        self._order = itertools.count()
        self._events: list[tuple[int, int, LoopTurns | VirtualTimer]] = []
        self._loops: dict[DrivenLoop, LoopTurns] = {}
        self.baton = Baton()
        self._turns = threading.Condition(self.baton)  # type: ignore[arg-type]  # real: one thread at a time
        self._participants: dict[threading.Thread, Participant] = {}
        self._interrupts = 0

    def keep_pace(self) -> None:
        """From now on time passes as `time_scale` says."""
        self._scale, self._anchor = self._asked_scale, (time.monotonic(), self.now)

    def monotonic(self) -> float:
        return ZERO + self.now * 1e-9

    def unix(self) -> int:
        return UNIX + self.now

    def cpu(self) -> float:
        return 0.0

    def sleep(self, seconds: float) -> None:
        self.wait_until(lambda: False, seconds)

    def look(self) -> None:
        if self._is_nested():  # whoever waits looks all the time
            return
        if self._scale is None:
            self.wait_until(lambda: False, LOOK * 1e-9)
        else:  # what was due by now; the machine may never catch up with a time that runs on meanwhile
            self.wait_until(lambda: False, max(0.0, self._allowed() - self.now) * 1e-9)

    def later(self, seconds: float, task: Callable[[], None]) -> VirtualTimer:
        timer = VirtualTimer(task)
        with self.baton:
            heapq.heappush(self._events, (self.now + _ns(seconds), next(self._order), timer))
        return timer

    def condition(self) -> threading.Condition:
        return VirtualCondition(self.baton, self.wait_until)

    def take(self, queue: SimpleQueue[T], timeout: float) -> T:
        if not self.wait_until(lambda: not queue.empty(), timeout):
            raise Empty
        return queue.get_nowait()

    def thread(self, target: Callable[[], object], name: str) -> threading.Thread:
        def run() -> None:
            self.wait_until(lambda: True, None)  # for its turn
            try:
                target()
            finally:
                self._end(thread)

        thread = threading.Thread(target=run, name=name, daemon=True)
        with self.baton:
            self._participants[thread] = Participant(thread, idle=IdleTime(thread))
        return thread

    def drive(self, loop: DrivenLoop) -> None:
        with self.baton:
            turns = self._loops[loop] = LoopTurns(loop)
            loop.on_task(partial(self._wake, turns))
            self._plan(turns, loop.due())

    def release(self, loop: DrivenLoop) -> None:
        with self.baton:
            loop.on_task(None)
            self._loops.pop(loop).at = None

    def bits(self, count: int) -> int:
        with self.baton:
            return self._random.getrandbits(count)

    def draw(self) -> float:
        """A random number from 0 to 1."""
        return self._random.random()

    def process(self) -> int:
        return next(self._processes)

    def host(self) -> str:
        return "simulation"

    def wait_until(self, is_so: Callable[[], bool], timeout: float | None) -> bool:
        with self.baton, self._interrupted_between_events():
            me = self._me()
            wait = Wait(is_so, math.inf if timeout is None else self.now + _ns(timeout))
            me.waits.append(wait)
            me.idle = None
            try:
                self._run_alone(wait)
                while (first := self._first_to_work(me)) is not me:
                    if first is None:
                        self._go_on()
                    else:
                        self._let_work()
                return wait.is_so()
            finally:
                me.waits.remove(wait)
                me.idle = None if me.waits else IdleTime(me.thread)
                self._turns.notify_all()

    def _run_alone(self, wait: Wait) -> None:
        """The quick way of a single thread: one event after another until it has what it waits for."""
        events, wanting = self._events, self.baton.wanting
        while len(self._participants) == 1 and self._scale is None and events and events[0][0] <= wait.end:
            if self.now >= wait.end or self._interrupts or wanting or wait.is_so():
                return
            at, _, event = heapq.heappop(events)
            if at > self.now:
                self.now = at
            self._happen(event)

    def _first_to_work(self, me: Participant) -> Participant | None:
        """Who is at work, or may be as what it waits for is there; None where everybody waits for what comes."""
        if len(self._participants) == 1:
            return me if self._has_what_it_waits_for(me) else None
        everybody = self._participants.values()
        at_work = next((each for each in everybody if each is not me and self._is_waited_for(each)), None)
        return at_work or next((each for each in everybody if self._has_what_it_waits_for(each)), None)

    def _let_work(self) -> None:
        self._turns.notify_all()
        self._turns.wait(BLINK)
        self._raise_interrupts()

    def _has_what_it_waits_for(self, each: Participant) -> bool:
        wait = each.waits[-1] if each.waits and each.idle is None else None
        return wait is not None and (self.now >= wait.end or wait.is_so())

    def _is_waited_for(self, each: Participant) -> bool:
        has_ended = each.thread.ident is not None and not each.thread.is_alive()
        return each.idle is not None and not has_ended and each.idle.seconds() < GRACE

    def _go_on(self) -> None:
        """Lets the next event happen, or time pass up to where somebody has waited long enough."""
        until = min((each.waits[-1].end for each in self._participants.values() if each.waits), default=math.inf)
        due = self._events[0][0] if self._events else math.inf
        then = min(until, due)
        if self._scale is not None and then > self._allowed():
            self._turns.wait(min(BLINK, max(0.0, self._real(then) - time.monotonic())))
            return self._raise_interrupts()
        if due > until:
            self.now = int(until)
        elif due < math.inf:
            self.now = max(self.now, int(due))
            self._happen(heapq.heappop(self._events)[2])
        else:
            self._turns.wait(BLINK)  # nothing will happen by itself
        self._raise_interrupts()
        if self.baton.wanting:
            self._turns.wait(0.001)

    def _happen(self, event: LoopTurns | VirtualTimer) -> None:
        if isinstance(event, VirtualTimer):
            task, event.task = event.task, None
            if task is not None:
                task()
        elif event.at is not None and event.at <= self.now and not event.is_busy:
            event.at, event.is_busy = None, True
            loop, now, due = event.loop, ZERO + self.now * 1e-9, 0.0
            try:
                for _ in range(AT_ONCE):
                    loop.turn()
                    due = loop.due()
                    if due > now:
                        break
            except BaseException:
                due = loop.due()
                raise
            finally:
                event.is_busy = False
                self._plan(event, due)

    def _plan(self, turns: LoopTurns, due: float) -> None:
        """The next turn of a loop that has something to do at `due` [s] monotonic, unless it was released meanwhile."""
        if due < math.inf and turns.loop in self._loops:
            at = math.floor((due - ZERO) * 1e9) + 1
            self._plan_at(turns, at if at > self.now else self.now)

    def _wake(self, turns: LoopTurns) -> None:
        if turns.at is not None and turns.at <= self.now:  # its turn is due already, and finds the task
            return
        with self.baton:
            if not turns.is_busy:  # else it is looked at after its turn
                self._plan_at(turns, self.now)

    def _plan_at(self, turns: LoopTurns, at: int) -> None:
        if turns.at is None or at < turns.at:
            turns.at = at
            heapq.heappush(self._events, (at, next(self._order), turns))

    def _allowed(self) -> float:
        """[ns] up to which virtual time may have passed by now."""
        real, virtual = self._anchor
        return virtual + (time.monotonic() - real) * (self._scale or math.inf) * 1e9

    def _real(self, then: float) -> float:
        """[s] of real time at the virtual time `then` [ns]."""
        real, virtual = self._anchor
        return real + (then - virtual) * 1e-9 / (self._scale or math.inf)

    def _me(self) -> Participant:
        thread = threading.current_thread()
        if thread not in self._participants:
            ended = [each for each in self._participants if each.ident is not None and not each.is_alive()]
            for each in ended:
                del self._participants[each]
            self._participants[thread] = Participant(thread)
        return self._participants[thread]

    def _end(self, thread: threading.Thread) -> None:
        with self.baton:
            self._participants.pop(thread, None)
            self._turns.notify_all()

    @contextmanager
    def _interrupted_between_events(self) -> Iterator[None]:
        """Ctrl-C must not break off a service in the middle of an event, as it does not where they are processes."""
        if threading.current_thread() is not threading.main_thread() or self._is_nested():
            yield
            return
        before = signal.getsignal(signal.SIGINT)
        if not callable(before):
            yield
            return
        self._handler = before
        signal.signal(signal.SIGINT, self._note_interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _is_nested(self) -> bool:
        me = self._participants.get(threading.current_thread())
        return me is not None and bool(me.waits)

    def _note_interrupt(self, _number: int, _frame: FrameType | None) -> None:
        self._interrupts += 1

    def _raise_interrupts(self) -> None:
        if self._interrupts and threading.current_thread() is threading.main_thread() and self._is_outermost():
            self._interrupts -= 1
            self._handler(signal.SIGINT, None)

    def _is_outermost(self) -> bool:
        return len(self._participants[threading.current_thread()].waits) == 1


def _ns(seconds: float) -> int:
    """At least 1 of what is above 0: whoever waits for the rest of a time, until none is left, comes to its end."""
    return max(1, round(seconds * 1e9)) if seconds > 0.0 else 0
