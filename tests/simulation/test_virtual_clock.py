"""Virtual time that is scaled to real time."""

from __future__ import annotations

import threading
import time

import pytest

from gemelo.tools.simulation.virtual_clock import GRACE, VirtualClock


@pytest.mark.parametrize("scale", [1.0, 1e9])
def test_a_look_ends_also_where_nothing_happens_and_where_time_runs_faster_than_the_machine(scale: float) -> None:
    clock = VirtualClock(time_scale=scale)
    clock.keep_pace()
    time.sleep(0.01)  # what it looks at
    looking = threading.Thread(target=clock.look, daemon=True)
    looking.start()
    looking.join(60.0)
    assert not looking.is_alive()
    assert clock.now >= 0.009 * scale * 1e9


def test_a_wait_for_less_than_a_nanosecond_takes_time_too() -> None:
    """The rest of 0.2 s may be 1e-13 s by rounding: waited for in no time it would be left for ever."""
    clock = VirtualClock()
    before = clock.monotonic()
    assert not clock.wait_until(lambda: False, 1e-13)
    assert clock.monotonic() > before


@pytest.mark.parametrize("seconds", [0.0, 2.5 * GRACE])
def test_time_stands_still_while_a_thread_computes_however_long_the_machine_takes_for_it(seconds: float) -> None:
    clock, ended = VirtualClock(), list[float]()

    def compute() -> None:
        clock.sleep(1.0)
        end = time.thread_time() + seconds
        while time.thread_time() < end:
            pass
        clock.sleep(0.5)
        ended.append(clock.now * 1e-9)

    clock.sleep(0.0)  # time is this thread's too from now on
    clock.thread(compute, "computing").start()
    clock.sleep(10.0)
    assert ended == [1.5]


def test_a_thread_that_waits_for_something_else_is_waited_for_no_longer() -> None:
    clock, may_go_on = VirtualClock(), threading.Event()

    def wait() -> None:
        clock.sleep(1.0)
        may_go_on.wait(30.0)

    clock.sleep(0.0)  # as above
    waiting = clock.thread(wait, "waiting")
    waiting.start()
    clock.sleep(10.0)
    assert clock.now == 10_000_000_000
    may_go_on.set()
    waiting.join(60.0)
    assert not waiting.is_alive()
