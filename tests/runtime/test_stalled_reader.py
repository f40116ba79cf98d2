"""A viewer that stops reading silences the others for seconds at a router with Zenoh's defaults; at ours, for a moment.

What it does to an arm that moves: tests/stack/test_hostile_viewer.py.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from operator import sub

import pytest

from gemelo.libraries.runtime.bus.interface import Arrival
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_config import LONGEST_BLOCK_US
from gemelo.schemas.topics import JOINT_STATES, LOG, STATISTICS
from tests.runtime.support import ROOT, RouterProcess, until

LONGEST = LONGEST_BLOCK_US * 1e-6  # [s] that one message waits for who does not read
SILENT = 2.0  # [s] without a state: 4 times LONGEST, and less than the 5 s that Zenoh waits by itself
SIZE = 200_000  # [bytes] of what is said besides, 50 times a second: fills what the kernel keeps for who does not read
PERIOD = 0.02  # [s]
WATCHED = 4.0  # [s]
MARGIN = 0.4  # [s] of a busy machine


class PlainRouter(RouterProcess):
    """The same program with Zenoh's own settings: 2 threads that receive, and 5 s for who does not read."""

    def start(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        file = self.folder / "plain.json5"
        listen = {"endpoints": [f"tcp/127.0.0.1:{self.port}"]}
        silent = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
        file.write_text(json.dumps({"mode": "router", "listen": listen, "scouting": silent}))
        self.environ["GEMELO_ROUTER_CONFIGURATION"] = str(file)
        self.environ["ZENOH_RUNTIME"] = "(rx: (worker_threads: 2))"
        super().start()


@contextmanager
def stalled(router: RouterProcess) -> Iterator[threading.Event]:
    """A viewer that reads one message and no more; set when it has."""
    has_heard = threading.Event()
    with subprocess.Popen(
        [sys.executable, "-m", "tests.stack.hostile", "stalled"], cwd=ROOT, stdout=subprocess.PIPE, text=True,
        env=os.environ | {"GEMELO_ROUTER_PORT": str(router.port)},
    ) as process:  # fmt: skip
        assert process.stdout is not None
        threading.Thread(target=lambda: process.stdout.readline() and has_heard.set(), daemon=True).start()
        try:
            yield has_heard
        finally:
            process.kill()


def longest_silences(router: RouterProcess) -> dict[str, float]:
    """[s] without a state of the arm, and without a word of another writer, beside a reader that has stopped reading.

    Watched for WATCHED, or until the arm has been silent for SILENT.
    """
    heard: dict[str, list[float]] = {JOINT_STATES.key: [], STATISTICS.key: []}
    gateway, planner, operator = (ZenohBus(router.deployment.router, "rm1") for _ in range(3))
    for topic in (JOINT_STATES, STATISTICS):
        note = partial(_note, heard[topic.key])
        operator.subscribe(topic.key, topic.delivery, note, lambda missed: None)
    states, much, other = (
        bus.publish(topic.key, topic.message.__name__, topic.delivery, writer)
        for bus, topic, writer in (
            (gateway, JOINT_STATES, "stepper_gateway"),
            (gateway, LOG, "stepper_gateway"),
            (planner, STATISTICS, "planner"),
        )
    )
    with closing(gateway), closing(planner), closing(operator), stalled(router) as has_stopped:
        assert until(lambda: states.put(b"") or (heard[JOINT_STATES.key] and has_stopped.is_set()), 30.0)
        for times in heard.values():
            times[:] = [time.monotonic()]
        ends = time.monotonic() + WATCHED
        while (now := time.monotonic()) < ends and now - heard[JOINT_STATES.key][-1] < SILENT:
            for publication, size in ((states, 300), (other, 300), (much, SIZE)):
                publication.put(b"x" * size)
            time.sleep(PERIOD)
    return {key: max(map(sub, [*times[1:], now], times)) for key, times in heard.items()}


def _note(times: list[float], arrival: Arrival) -> None:
    times.append(time.monotonic())


@pytest.mark.parametrize(("kind", "is_open"), [(PlainRouter, True), (RouterProcess, False)], ids=["open", "closed"])
def test_who_stops_reading_silences_an_arm_for_seconds_only_where_the_lock_is_open(tmp_path, kind, is_open, capsys):
    router = kind(tmp_path)
    try:
        longest = longest_silences(router)
    finally:
        router.stop()
    with capsys.disabled():
        print(" the longest silence:", ", ".join(f"{key} {each:.2f} s" for key, each in longest.items()), end="")
    if is_open:
        assert longest[JOINT_STATES.key] > SILENT
    else:
        assert 0.8 * LONGEST < max(longest.values()) < 2 * LONGEST + MARGIN  # felt, and over
