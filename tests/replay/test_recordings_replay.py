"""The recordings that are kept with the code give the same outputs, to the byte, in every run."""

from __future__ import annotations

import os
import subprocess
import sys

import msgspec
import pytest

from gemelo.tools.replay.main import SERVICES, Replayed, replay, text_of
from tests.replay.conftest import RECORDINGS

LEAST = {  # messages that are compared, by topic
    "planner": {"@request/plan": 8, "planned_path": 5},
    "stepper_gateway": {
        "joint_states": 300, "joint_commands": 300, "step_errors": 300, "device/state": 300, "commands": 100,
        "command_acks": 100, "follow_joint_trajectory/ended": 3,
        "device/events": 3, "device/status": 1, "step_ledger": 20, "stopping_distance": 50,
        "frames, results, answers and log lines": 300,
    },
    "state_publisher": {"frames": 300, "static_frames": 1},
}  # fmt: skip
ROUNDED = 1e-9  # share by which floats may differ on another processor, whose libraries round otherwise
REMEDY = "where the change is meant, make the recordings anew: `make recordings`"


@pytest.mark.parametrize("service", SERVICES)
def test_a_recording_gives_the_same_outputs_to_the_byte(service: str):
    file = RECORDINGS / f"{service}.mcap"
    replayed = replay(file, service)
    if replayed.difference is not None and replayed.other_versions:  # made elsewhere: to the byte in every run here
        replayed = replay(file, service, tolerance=ROUNDED)
    assert replayed.difference is None, f"{text_of(replayed)}\n{REMEDY}"
    for topic, least in LEAST[service].items():
        assert replayed.alike[topic] >= least, text_of(replayed)


@pytest.mark.parametrize("service", SERVICES)
def test_a_recording_is_small_enough_to_be_kept(service: str):
    assert (RECORDINGS / f"{service}.mcap").stat().st_size < 1_000_000


@pytest.mark.parametrize("service", SERVICES)
def test_it_does_not_depend_on_the_order_of_sets(service: str):
    """Two processes, in which words have other hashes."""
    said = [_in_a_process(service, seed) for seed in ("1", "2")]
    assert said[0].alike == said[1].alike
    assert said[0].difference == said[1].difference


def _in_a_process(service: str, seed: str) -> Replayed:
    command = [sys.executable, "-m", "gemelo.tools.replay", str(RECORDINGS / f"{service}.mcap"), service, "--json"]
    done = subprocess.run(command, env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, timeout=300)
    assert done.returncode in (0, 1), done.stderr
    return msgspec.json.decode(done.stdout, type=Replayed)
