"""What the whole stack costs while the arm stands: 50 states a second through every process."""

from __future__ import annotations

import time

from services.bench.figure import Figure, Goal, of_samples
from services.bench.stack_processes import cpu_seconds, families
from services.bench.stacks import Stacks

UNIT = "% of one core"
GOAL = Goal(median=25.0)
SETTLE, WINDOW, WINDOWS = 3.0, 2.0, 5  # [s], [s]


def measure(stacks: Stacks) -> Figure:
    running = stacks.any_broker()
    processes = families(running.stack)
    time.sleep(SETTLE)
    samples, first = [], {name: cpu_seconds(family) for name, family in processes.items()}
    before, began = first, time.monotonic()
    for _ in range(WINDOWS):
        started = time.monotonic()
        time.sleep(WINDOW)
        after = {name: cpu_seconds(family) for name, family in processes.items()}
        samples.append(sum(after.values()) - sum(before.values()))
        samples[-1] *= 100.0 / (time.monotonic() - started)
        before = after
    whole = time.monotonic() - began
    shares = sorted(((after[name] - first[name]) / whole * 100.0, name) for name in first)
    note = f"{len(first)} processes, broker {running.deployment.mqtt.broker}, {WINDOWS} windows of {WINDOW:g} s: " + (
        ", ".join(f"{name} {share:.1f}" for share, name in reversed(shares))
    )
    return of_samples(samples, UNIT, GOAL, note=note)
