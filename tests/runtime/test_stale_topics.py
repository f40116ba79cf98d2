"""Ages at which a topic that comes less often while nothing in it changes counts as stale."""

from __future__ import annotations

import pytest

from gemelo.libraries.runtime.bus.interface import Arrival
from gemelo.libraries.runtime.clock import SystemClock
from gemelo.libraries.runtime.loop.task_queue import Gaps, UnreadQueue
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES


class SetClock(SystemClock):
    """Its [s] monotonic are as a test sets them."""

    now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.mark.parametrize(
    ("gaps", "stale_after"),
    [
        ((), 0.5),
        ((0.02,) * 5, 0.1),
        ((0.02,) * 5 + (0.1,), 0.5),
        ((0.1,) * 5 + (0.02, 0.02), 0.5),
        ((0.1,) * 5 + (0.02,) * 3, 0.1),
        ((0.02, 0.02, 0.001), 0.1),
        ((0.001,) * 3, 0.1),
        ((3.0,), 0.5),
    ],
)
def test_five_of_the_longest_of_its_last_three_gaps_make_it_stale(gaps: tuple[float, ...], stale_after: float) -> None:
    clock = SetClock()
    latest = Latest(JOINT_STATES, clock)
    assert latest.is_stale
    for gap in (*gaps, 0.0):
        latest.on_message(JointState(stamp=1))
        clock.now += gap
    assert not latest.is_stale
    clock.now += stale_after - 0.001
    assert not latest.is_stale
    clock.now += 0.002
    assert latest.is_stale


def test_an_arm_that_comes_to_rest_is_never_stale_and_one_that_falls_silent_in_motion_is_after_a_tenth() -> None:
    clock = SetClock()
    latest = Latest(JOINT_STATES, clock)
    for gap in (*(0.02,) * 20, 0.04, 0.08, *(0.1,) * 20, *(0.02,) * 4):
        latest.on_message(JointState(stamp=1))
        clock.now += 0.999 * gap
        assert not latest.is_stale
    clock.now += 0.1
    assert latest.is_stale


def test_what_nobody_has_looked_at_counts_for_the_gaps_too() -> None:
    clock = SetClock()
    queue = UnreadQueue(clock)
    for _ in range(4):
        queue.on_arrival(Arrival("joint_states", "", b""))
        clock.now += 0.03
    assert queue.passed_over == 3
    assert queue.gaps.longest(9.0) == pytest.approx(0.03)
    assert Gaps().longest(9.0) == 9.0
