"""The loop and its schedule on a counted clock: an exact grid, whatever single steps take."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime import endpoints
from gemelo.libraries.runtime.bus.identity import identify
from gemelo.libraries.runtime.clock import SystemClock
from gemelo.libraries.runtime.loop import loop as loop_module
from gemelo.libraries.runtime.loop.loop import Loop, LoopFigures, Schedule
from gemelo.libraries.runtime.loop.task_queue import Task, TaskQueue
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest

RATES = st.sampled_from([1.0, 2.0, 10.0, 25.0, 50.0, 100.0, 1000.0])
DURATIONS = st.lists(st.floats(0.0, 0.2), min_size=1, max_size=50)


@given(RATES, st.floats(0.0, 1e6), DURATIONS)
def test_every_step_is_due_on_the_grid_and_after_the_one_before(
    rate: float, start: float, durations: list[float]
) -> None:
    schedule = Schedule(rate, start)
    now = start
    for duration in durations:
        now = max(now, schedule.deadline)
        begun = schedule.deadline
        schedule.begin(now)
        now += duration
        schedule.end(now)
        slot = (schedule.deadline - start) * rate
        assert slot == pytest.approx(round(slot), abs=1e-3)
        assert schedule.deadline > begun
        assert now < schedule.deadline + 1e-6
        assert schedule.deadline <= max(now, begun) + 1.0 / rate + 1e-6


def test_a_million_short_steps_do_not_drift() -> None:
    schedule = Schedule(50.0, 0.0)
    for _ in range(1_000_000):
        schedule.begin(schedule.deadline)
        schedule.end(schedule.deadline)
    assert schedule.deadline == 20_000.0


def test_lateness_is_the_worst_since_the_last_report() -> None:
    schedule = Schedule(10.0, 0.0)
    for late in (0.01, 0.03, 0.0):
        schedule.begin(schedule.deadline + late)
        schedule.end(schedule.deadline)
    figures = schedule.take_figures()
    assert (figures.steps, figures.late_max) == (3, pytest.approx(0.03))
    assert schedule.take_figures().steps == 0


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_rate_must_be_above_zero(rate: float) -> None:
    with pytest.raises(ValueError, match="above 0"):
        Schedule(rate, 0.0)


class CountedClock(SystemClock):
    """A clock that goes on only where something waits or says how long it took."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def cpu(self) -> float:
        return self.now / 4.0

    def unix(self) -> int:
        return round(self.now * 1e9)

    def spend(self, seconds: float) -> None:
        self.now += seconds


class CountedQueue(TaskQueue):
    """A queue whose waiting takes counted time."""

    def __init__(self, clock: CountedClock) -> None:
        super().__init__()
        self._clock = clock

    def take(self, timeout: float) -> Task | None:
        task = super().take(0.0)
        if task is None:
            self._clock.spend(max(timeout, 0.0))
        return task


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> CountedClock:
    clock = CountedClock()
    monkeypatch.setattr(loop_module, "TaskQueue", lambda: CountedQueue(clock))
    return clock


def steps_of(loop: Loop, clock: CountedClock, rate: float, until: float, slow: dict[int, float]) -> list[float]:
    """[s] when each step began until `until` [s]; `slow` says how long [s] which step takes."""
    begins: list[float] = []

    def step(now: int) -> None:
        begins.append(clock.now)
        clock.spend(slow.get(len(begins) - 1, 0.001))
        if clock.now >= until:
            loop.stop.set()

    loop.spin(step, rate)
    return begins


def test_the_rate_is_exact_and_a_slow_step_does_not_shift_it(clock: CountedClock) -> None:
    begins = steps_of(Loop(ShutdownRequest(), clock), clock, 50.0, until=1.0, slow={20: 0.055})
    grid = [k / 50.0 for k in range(51) if k not in (21, 22)]  # 20 lasts until 0.455: two deadlines are slept through
    assert begins == pytest.approx(grid, abs=1e-9)


def test_a_flood_does_not_starve_the_step(clock: CountedClock) -> None:
    loop = Loop(ShutdownRequest(), clock)
    for _ in range(2000):
        loop.tasks.put(lambda: clock.spend(0.0005))
    begins = steps_of(loop, clock, 50.0, until=0.6, slow={})
    late = [begin - k / 50.0 for k, begin in enumerate(begins)]
    assert len(begins) == 31
    assert 0.0 <= min(late) <= max(late) <= 0.0005 + 1e-9  # by one message at most


def test_slow_steps_and_slow_messages_take_turns(clock: CountedClock) -> None:
    loop = Loop(ShutdownRequest(), clock)
    turns: list[str] = []

    def handle() -> None:
        turns.append("message")
        clock.spend(0.02)

    def step(now: int) -> None:
        turns.append("step")
        clock.spend(0.02)
        if len(turns) > 18:
            loop.stop.set()

    for _ in range(10):
        loop.tasks.put(handle)
    loop.spin(step, 100.0)
    assert turns == ["step", "message"] * 10


def test_statistics_say_the_rate_since_the_report_before(clock: CountedClock) -> None:
    statistics = endpoints.LoopStatistics(identify("planner"), clock)
    clock.spend(0.4)
    assert statistics.report(LoopFigures(20, 0.0), ()) is None
    clock.spend(0.6)
    report = statistics.report(LoopFigures(50, 0.003), ())
    assert report is not None
    assert (report.loop_rate, report.loop_late_max, report.cpu) == (50.0, 0.003, 0.25)
