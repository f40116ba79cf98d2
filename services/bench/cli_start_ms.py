"""From starting `gemelo` to its first output."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

from services.bench.figure import Figure, Goal, of_samples

UNIT = "ms"
GOAL = Goal(p99=500.0)
ROUNDS = 15
GEMELO = (sys.executable, "-m", "services.cli.main")


def measure() -> Figure:
    """`gemelo topic list` and `gemelo --help`, in turns; the worse of both at every turn."""
    samples, helps, bare = [], [], []
    for _ in range(ROUNDS):
        listing = first_output(*GEMELO, "topic", "list")
        help_ = first_output(*GEMELO, "--help")
        samples.append(max(listing, help_))
        helps.append(help_)
        bare.append(first_output(sys.executable, "-c", "print()"))
    reference = {"python -c 'print()'": statistics.median(bare), "gemelo --help": statistics.median(helps)}
    return of_samples(samples, UNIT, GOAL, reference, f"gemelo topic list, {ROUNDS} starts")


def first_output(*command: str) -> float:
    """[ms] until the first byte."""
    started = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.read(1)
        took = (time.perf_counter() - started) * 1e3
        process.stdout.read()
    return took
