"""Nothing of a stack outlives the process that has started it."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.stack.guard import Guard

LAST = 40.0  # [s] that a busy machine may need to end two processes
OWNER = """
import sys, time
from gemelo.tools.stack.stack import Stack
stack = Stack(processes=("router", "broker"))
stack.start()
print(stack.server.pid, *stack.pids().values(), stack.folder, flush=True)
time.sleep(300.0)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_stack_ends_with_the_process_that_has_started_it(number: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", OWNER], cwd=project_root(), stdout=subprocess.PIPE, text=True
    ) as owner:
        try:
            assert owner.stdout is not None
            *pids, folder = owner.stdout.readline().split()
            assert len(pids) == 3
            owner.send_signal(number)
            owner.wait(LAST)
        finally:
            owner.kill()
    deadline = time.monotonic() + LAST
    while living := [pid for pid in pids if lives(int(pid))]:
        assert time.monotonic() < deadline, living
        time.sleep(0.05)
    shutil.rmtree(folder)


def test_a_guard_that_is_closed_sends_nothing() -> None:
    with subprocess.Popen(["sleep", "300"]) as watched:
        try:
            guard = Guard(watched.pid)
            guard.close()
            assert watched.poll() is None
        finally:
            watched.kill()
    assert watched.returncode == -signal.SIGKILL


def lives(pid: int) -> bool:
    """False for a process that has ended, waited for or not."""
    try:
        os.kill(pid, 0)
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False
