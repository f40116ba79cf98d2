"""A program that lives no longer than its parent."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys

from services.visualizer.binary import environment

PATIENCE = 2.0  # [s] between asking and killing
_PR_SET_PDEATHSIG = 1  # of prctl(2)


def start(command: list[str], stderr: int | None = None) -> subprocess.Popen[bytes]:
    """Start it; on Linux the kernel ends it with this process, however that ends. `stderr` as for `Popen`."""
    return subprocess.Popen(command, env=environment(os.environ), preexec_fn=_die_with_parent, stderr=stderr)


def stop(child: subprocess.Popen[bytes]) -> None:
    """End it, politely first."""
    if child.poll() is None:
        child.terminate()
        try:
            child.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


def _die_with_parent() -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
