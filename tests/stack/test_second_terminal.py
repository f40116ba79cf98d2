"""`make up` with a robot and a cell; a second terminal of the same folder, whose environment knows neither."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from gemelo.tools.stack.stack import Stack

LONGEST = 60.0  # [s] of one command
STARTED = {"GEMELO_ROBOT": "urdf/parol6", "GEMELO_CELL": "urdf/parol6/cell.toml"}


@pytest.fixture(scope="module")
def stack() -> Iterator[Stack]:
    with Stack(command=("make", "--silent", "up"), environment=STARTED, panel=True, ready_timeout=120.0) as running:
        yield running


@pytest.fixture
def terminal(stack: Stack) -> dict[str, str]:
    """Nothing of `make up`'s environment but where the file of the run is, which is the folder's own for a user."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("GEMELO_")}
    return {**own, "GEMELO_STARTED": stack.deployment["GEMELO_STARTED"]}


def printed(stack: Stack) -> list[str]:
    """The commands that `make up` prints."""
    end = time.monotonic() + 30.0
    while "stop it" not in stack.console():
        assert time.monotonic() < end, stack.console()
        time.sleep(0.1)
    return re.findall(r"\.venv/bin/gemelo [\w -]+", stack.console().partition("gemelo is up")[2])


def run(stack: Stack, terminal: dict[str, str], command: str) -> str:
    done = subprocess.run(
        command, shell=True, cwd=stack.root, env=terminal, capture_output=True, text=True, timeout=LONGEST, check=False
    )
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


def test_every_command_that_make_up_prints_works_as_printed(stack, terminal):
    commands = printed(stack)
    assert len(commands) >= 4
    said = {command: run(stack, terminal, command) for command in commands}
    assert "joint_6" in said[".venv/bin/gemelo state"]


def test_its_cameras_see_what_the_twin_was_started_with(stack, terminal):
    assert "overhead" in run(stack, terminal, ".venv/bin/gemelo camera list")
    run(stack, terminal, ".venv/bin/gemelo detect")


def test_doctor_says_what_runs(stack, terminal):
    ended = subprocess.run(
        ".venv/bin/gemelo doctor", shell=True, cwd=stack.root, env=terminal, capture_output=True, text=True,
        timeout=LONGEST, check=False,
    )  # fmt: skip
    assert "runs parol6" in ended.stdout
    assert "urdf/parol6/cell.toml" in ended.stdout
    assert "start the twin with" not in ended.stdout


def test_an_example_that_is_a_node_hears_the_robot_that_runs(stack, terminal):
    command = [sys.executable, "-u", "examples/10_joint_monitor.py"]
    with subprocess.Popen(command, cwd=stack.root, env=terminal, text=True, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            assert "joint_6" in process.stdout.readline()
        finally:
            process.kill()
