"""A person at a desk, as a process of its own: moves the arm, and says on stdout what came of it.

For each line of stdin one move; `moving` is printed in the middle of it, and a line of JSON at its end.
"""

from __future__ import annotations

import json
import os
import sys
from itertools import pairwise
from types import SimpleNamespace

from tests.stack.person import Operator, jumps

SPEED = 0.4
AFTERWARDS = 50  # joint states that are watched after the end of a move


def main() -> None:
    operator = Operator(SimpleNamespace(environment=os.environ), name="desk")
    try:
        outcome, _ = operator.move_again()
        say(ready=outcome.status.name)
        for _ in sys.stdin:
            say(**move(operator))
    finally:
        operator.close()


def move(operator: Operator) -> dict[str, object]:
    plan = operator.plan(SPEED)
    handle = operator.send(plan)
    is_midway = operator.wait_for(lambda: elapsed(handle) > 0.3 * plan.duration, 10.0)
    print("moving" if is_midway else "not moving", flush=True)
    outcome = handle.wait(plan.duration + 20.0)
    way = list(operator.seen)
    operator.seen.clear()
    operator.wait_for(lambda: len(operator.seen) >= AFTERWARDS, 5.0)
    return {
        "status": outcome.status.name,
        "is_exact": outcome.result.executed_steps == outcome.result.commanded_steps,
        "jumps": jumps(operator.arm, way),
        "longest_gap": max(after.stamp - before.stamp for before, after in pairwise(way)) * 1e-9,
        "positions_afterwards": len({state.position for state in operator.seen}),
    }


def elapsed(handle) -> float:
    return handle.feedback.elapsed if handle.feedback is not None else 0.0


def say(**what: object) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main()
