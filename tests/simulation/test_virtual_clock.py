"""Virtual time that is scaled to real time."""

from __future__ import annotations

import threading
import time

import pytest

from services.simulation.virtual_clock import VirtualClock


@pytest.mark.parametrize("scale", [1.0, 1e9])
def test_a_look_ends_also_where_nothing_happens_and_where_time_runs_faster_than_the_machine(scale: float) -> None:
    clock = VirtualClock(time_scale=scale)
    clock.keep_pace()
    time.sleep(0.01)  # what it looks at
    looking = threading.Thread(target=clock.look, daemon=True)
    looking.start()
    looking.join(10.0)
    assert not looking.is_alive()
    assert clock.now >= 0.009 * scale * 1e9


def test_a_wait_for_less_than_a_nanosecond_takes_time_too() -> None:
    """The rest of 0.2 s may be 1e-13 s by rounding: waited for in no time it would be left for ever."""
    clock = VirtualClock()
    before = clock.monotonic()
    assert not clock.wait_until(lambda: False, 1e-13)
    assert clock.monotonic() > before
