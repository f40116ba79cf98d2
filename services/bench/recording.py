"""Figures of the recording on a running stack while the arm moves: what it costs the processor and the disk."""

from __future__ import annotations

import time
from pathlib import Path

from services.bench.figures import Figure, NotMeasured, of_samples
from services.bench.latency import swing
from services.bench.stack import Running, Stacks, cpu_seconds, families

SETTLE = 3.0  # [s] of motion that are not counted
WINDOW, WINDOWS = 5.0, 4  # [s]
LOGGER = "logger"


def record_cpu_percent(stacks: Stacks) -> Figure:
    """CPU time [% of one core] of the logger, which records everything that is said while the arm moves."""
    running = stacks.any_broker()
    processes = families(running.stack)[LOGGER]
    swing(running, SETTLE)
    samples = []
    for _ in range(WINDOWS):
        before, began = cpu_seconds(processes), time.monotonic()
        swing(running, WINDOW)
        samples.append((cpu_seconds(processes) - before) / (time.monotonic() - began) * 100.0)
    return of_samples(samples, note=f"{WINDOWS} windows of {WINDOW:g} s of streamed motion, every topic recorded")


def record_mb_per_hour(stacks: Stacks) -> Figure:
    """Growth [MB/h] of the logger's MCAP while the arm moves; an arm that stands sends no chunks and takes less."""
    running = stacks.any_broker()
    swing(running, SETTLE)
    file = _newest(running)
    samples = []
    for _ in range(WINDOWS):
        before, began = file.stat().st_size, time.monotonic()
        swing(running, WINDOW)
        samples.append((file.stat().st_size - before) / 1e6 / (time.monotonic() - began) * 3600.0)
    return of_samples(samples, note="zstd chunks, twice a second; with what Foxglove shows of frames, scene and log")


def _newest(running: Running) -> Path:
    """The file that is being written."""
    files = sorted((Path(running.deployment.paths.out) / "recordings").glob("*.mcap"))
    if not files:
        raise NotMeasured("the logger has begun no file")
    return files[-1]
