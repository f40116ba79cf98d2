"""The figure of the two brokers beside each other: a bare echo through either in the same run, and what they take."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil

from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.stack import has_mosquitto
from gemelo.tools.stack.stack import free_ports

BROKERS = ("embedded", "mosquitto")
BYTES, RATE, COUNT = 208, 100.0, 300  # of each echo [bytes], [Hz], [messages]
ROUNDS = 4  # of each broker, in turn, so that what else the machine does meets both
TO_START = 15.0  # [s]
FACTOR = 2.0  # of mosquitto's p99


def broker_echo_ms() -> Figure:
    """Round trip [ms] of a message of QoS 1 and its answer through the embedded broker; references: mosquitto's."""
    if not has_mosquitto():
        raise NotMeasured("mosquitto is not installed: apt-get install mosquitto")
    took: dict[str, list[float]] = {name: [] for name in BROKERS}
    with ExitStack() as running:
        serving = {name: running.enter_context(broker(name)) for name in BROKERS}
        for _ in range(ROUNDS):
            for name, (port, _) in serving.items():
                took[name] += echoes(port)
        memory = {name: resident_mb(process) for name, (_, process) in serving.items()}
    theirs = took["mosquitto"]
    reference = {"mosquitto median": quantile(theirs, 0.5), "mosquitto p99": quantile(theirs, 0.99)}
    reference |= {f"{name} RSS MB": size for name, size in memory.items()}
    note = (
        f"{len(took['embedded'])} and {len(theirs)} messages of {BYTES} bytes at {RATE:g} Hz, in turn; RSS without the "
        f"process that watches either; goal: {FACTOR:g} x mosquitto's p99"
    )
    return of_samples(took["embedded"], FigureGoal(p99=FACTOR * quantile(theirs, 0.99)), reference, note)


@contextmanager
def broker(name: str) -> Iterator[tuple[int, psutil.Process]]:
    """Port and process of a gemelo-broker of its own; raises NotMeasured if it does not start."""
    port = free_ports(1)[0]
    with tempfile.TemporaryDirectory() as folder:
        settings = {"GEMELO_MQTT_BROKER": name, "GEMELO_MQTT_PORT": str(port), "GEMELO_PATHS_RUN": folder}
        command = [sys.executable, "-m", "gemelo.services.broker.main", "--log-level", "warning"]
        process = subprocess.Popen(command, env=os.environ | settings)
        try:
            await_file(Path(folder, "broker.ready"), process)
            yield port, psutil.Process(process.pid)
        finally:
            process.terminate()
            process.wait(timeout=TO_START)


def await_file(file: Path, process: subprocess.Popen[bytes]) -> None:
    """Waits until it is there; raises NotMeasured if the process ends before, or it takes too long."""
    end = time.monotonic() + TO_START
    while not file.exists():
        if process.poll() is not None or time.monotonic() > end:
            raise NotMeasured(f"{file.stem} did not start")
        time.sleep(0.05)


def echoes(port: int) -> list[float]:
    """The round trips [ms] of one bare echo through the broker at `port`; raises NotMeasured if it fails."""
    numbers = {"port": port, "bytes-there": BYTES, "bytes-back": BYTES, "rate": RATE, "count": COUNT}
    options = [f"--{name}={value}" for name, value in numbers.items()]
    command = [sys.executable, "-m", "gemelo.tools.bench.traffic", "echo", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    if done.returncode:
        raise NotMeasured(f"an echo failed: {done.stderr.strip()}")
    took: list[float] = json.loads(done.stdout)
    return took


def resident_mb(process: psutil.Process) -> float:
    """Resident memory [MB] of one process."""
    return float(process.memory_info().rss) / 1e6
