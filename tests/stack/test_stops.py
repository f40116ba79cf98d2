"""SIGTERM and SIGSTOP of every process: a clean end in time, and no surprise after a pause."""

from __future__ import annotations

import os
import signal
import time

import psutil
import pytest

from gemelo.libraries.runtime.errors import ServerLost
from gemelo.schemas.actions import GoalStatusCode
from tests.stack.person import jumps

pytestmark = pytest.mark.alone

LONGEST_END = 3.0  # [s] from SIGTERM to the end of a process
PAUSE = 3.0  # [s] that a process stands still: longer than any lease or heartbeat
BOUND = 5.0  # [s] after the move's own time in which a waiting client must know


def end(stack, names):
    """SIGTERM to `names` at once; what did not end cleanly in time, by name."""
    processes = {name: psutil.Process(stack.kill(name, signal.SIGTERM)) for name in names}
    late = psutil.wait_procs(processes.values(), timeout=LONGEST_END)[1]
    time.sleep(0.2)  # process-compose, which starts it again after a second, notices
    codes = {name: stack.compose.process(name).exit_code for name in names}
    return {name: codes[name] for name in names if processes[name] in late or codes[name] != 0}


def test_each_process_ends_with_zero_on_sigterm_while_the_others_run(stack):
    for name in reversed(stack.processes):
        assert end(stack, [name]) == {}, stack.logs(name)[-2000:]
    stack.wait_ready(120.0)


def test_no_process_waits_for_a_frozen_router_to_end(stack):
    stack.wait_ready(120.0)
    router = stack.kill("router", signal.SIGSTOP)
    try:
        assert end(stack, [name for name in stack.processes if name != "router"]) == {}
    finally:
        os.kill(router, signal.SIGCONT)
    stack.wait_ready(120.0)


@pytest.mark.parametrize("name", ["virtual_esp32", "stepper_gateway"])
def test_a_process_that_stands_still_for_seconds_costs_the_move_at_most(stack, operator, name):
    plan = operator.plan(0.6)
    handle = operator.send(plan)
    assert operator.wait_for(operator.is_moving, 60.0)
    paused = stack.kill(name, signal.SIGSTOP)
    try:
        began = time.monotonic()
        try:
            told = handle.wait(plan.duration + BOUND)
        except ServerLost as error:
            told = error
        assert isinstance(told, ServerLost) or told.result.error_string
        operator.node.wait(began + PAUSE - time.monotonic())
    finally:
        os.kill(paused, signal.SIGCONT)
    operator.node.wait(1.0)
    assert not jumps(operator.arm, operator.seen)
    again, _ = operator.move_again()
    assert again.status is GoalStatusCode.SUCCEEDED, again.result.error_string
    assert stack.pid(name) == paused
