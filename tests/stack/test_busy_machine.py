"""A machine that has far too much to do: no step is lost, and where the OS gives priorities no heartbeat either."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

from gemelo.schemas.actions import GoalStatusCode
from tests.real_time import may_run_in_real_time
from tests.stack.person import Operator, jumps

pytestmark = pytest.mark.alone

HOGS = 16  # chosen: without priorities a stack beside them loses its heartbeats within seconds
SECONDS = 60  # that they live at the most
MOVES, SPEED = 2, 0.3  # of some 3 s each


@contextmanager
def hogs() -> Iterator[None]:
    """Programs that want all the time there is, each in a session of its own, as many people's would be."""
    program = f"import time\nend = time.monotonic() + {SECONDS}\nwhile time.monotonic() < end:\n    pass"
    with ExitStack() as stack:
        for _ in range(HOGS):
            hog = stack.enter_context(subprocess.Popen([sys.executable, "-c", program], start_new_session=True))
            stack.callback(hog.kill)
        yield


def test_a_machine_that_is_far_too_busy_delays_no_heartbeat(operator: Operator) -> None:
    for _ in range(MOVES):
        plan = operator.plan(SPEED)
        with hogs():
            outcome = operator.send(plan).wait(plan.duration + 20.0)
        assert not jumps(operator.arm, operator.seen)
        if not may_run_in_real_time() and outcome.status is GoalStatusCode.ABORTED:
            assert re.search("heartbeat|silent|joint state", outcome.result.error_string), outcome
            return
        assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
        assert outcome.result.executed_steps == outcome.result.commanded_steps
