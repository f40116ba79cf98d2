"""A person at a desk, as a process of its own: moves the arm, and says on stdout what came of it.

A line of stdin is a move: `move`, of a goal that goes on without its client, `attached`, of one that does not, or
`stop`, of one that is stopped midway.
`moving` is printed in the middle of it, a line of JSON when its end is heard, and for `again` one more after a move
that needed whatever a person had to do first.
"""

from __future__ import annotations

import json
import os
import sys
import time
from itertools import pairwise
from types import SimpleNamespace

from gemelo.libraries.runtime.errors import NoAnswer, ServerLost
from gemelo.schemas.device import DeviceStopRequest
from gemelo.schemas.topics import DEVICE_STOP
from tests.stack.person import Operator, jumps

SPEED = 0.4
AFTERWARDS = 50  # joint states that are watched after the end of a move
PATIENCE = 30.0  # [s] after the end of a trajectory


def main() -> None:
    operator = Operator(SimpleNamespace(environment=os.environ), name="desk")
    try:
        outcome, _ = operator.move_again()
        say(ready=outcome.status.name)
        for line in sys.stdin:
            word = line.strip()
            say(**again(operator) if word == "again" else move(operator, word == "attached", word == "stop"))
    finally:
        operator.close()


def move(operator: Operator, is_attached: bool = False, is_stopped: bool = False) -> dict[str, object]:
    plan = operator.plan(SPEED)
    handle = operator.send(plan, is_attached)
    is_midway = operator.wait_for(lambda: elapsed(handle) > 0.3 * plan.duration, 10.0)
    print("moving" if is_midway else "not moving", flush=True)
    began = time.monotonic()
    said: dict[str, object] = {"goal": plan.trajectory.points[-1].positions} | (stop(operator) if is_stopped else {})
    try:
        outcome = handle.wait(plan.duration + PATIENCE)
    except (ServerLost, NoAnswer) as error:
        return said | {"status": type(error).__name__, "why": str(error), "told_after": time.monotonic() - began}
    said["told_after"] = time.monotonic() - began
    way = list(operator.seen)
    operator.seen.clear()
    operator.wait_for(lambda: len(operator.seen) >= AFTERWARDS, 5.0)
    return said | {
        "status": outcome.status.name,
        "why": outcome.result.error_string,
        "is_exact": outcome.result.executed_steps == outcome.result.commanded_steps,
        "jumps": jumps(operator.arm, way),
        "longest_gap": max((after.stamp - before.stamp for before, after in pairwise(way)), default=0) * 1e-9,
        "positions_afterwards": len({state.position for state in operator.seen}),
    }


def stop(operator: Operator) -> dict[str, object]:
    """Whether it was carried out, and the time [ms] until that was said."""
    called = time.monotonic()
    answer = operator.node.call(DEVICE_STOP, DeviceStopRequest(), timeout=3.0)
    return {"stopped": answer.accepted, "stop_ms": (time.monotonic() - called) * 1e3}


def again(operator: Operator) -> dict[str, object]:
    """Where the arm stands, and the end of a move made as soon as the stack lets one; what a person had to do."""
    operator.seen.clear()
    operator.wait_for(lambda: operator.seen, 5.0)
    stands = operator.seen[-1].position if operator.seen else ()
    outcome, done = operator.move_again()
    why = outcome.result.error_string
    return {"stands": stands, "again": outcome.status.name, "why": why, "hands": [str(each) for each in done]}


def elapsed(handle) -> float:
    return handle.feedback.elapsed if handle.feedback is not None else 0.0


def say(**what: object) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main()
