"""A second `make up`: the bootstrap that skips what is done, and every process ready with a valid state."""

from __future__ import annotations

import subprocess
import time

from services.bench.figure import Figure, Goal, NotMeasured, of_samples
from services.bench.stacks import Stacks
from services.runtime.deployment import project_root
from services.stack.stack import Stack

UNIT = "s"
GOAL = Goal(median=8.0)
ROUNDS = 3


def measure(stacks: Stacks) -> Figure:
    stacks.stop()
    samples, skipping = [], []
    bootstrap()  # so that every round finds everything done
    for _ in range(ROUNDS):
        skipping.append(bootstrap())
        with Stack(viewer="none") as stack:
            samples.append(skipping[-1] + stack.ready_seconds)
            count = len(stack.processes)
    note = (
        f"deploy/bootstrap with everything done ({min(skipping):.2f} s), then {count} processes with amqtt, no viewer"
    )
    return of_samples(samples, UNIT, GOAL, note=note)


def bootstrap() -> float:
    """[s] that deploy/bootstrap takes."""
    started = time.monotonic()
    done = subprocess.run(["deploy/bootstrap"], cwd=project_root(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotMeasured(f"deploy/bootstrap failed: {(done.stderr or done.stdout)[-300:]}")
    return time.monotonic() - started
