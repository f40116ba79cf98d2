"""The rerun program as a child process, without its Python wrapper, which leaves it running when killed."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because

LOOPBACK = "127.0.0.1"
PATIENCE = 2.0  # [s] between asking and killing
_PR_SET_PDEATHSIG = 1  # of prctl(2)


class NoViewer(ReasonedError, RuntimeError):
    """The viewer's program is not installed."""


def rerun_binary() -> Path:
    """The path of the program in the installed package; raises `NoViewer` with the remedy where there is none."""
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise NoViewer(because("recording.viewer.not_installed"))
    folder = Path(spec.origin).parent
    for candidate in (folder / "Rerun.app/Contents/MacOS/Rerun", folder / "rerun", folder / "rerun.exe"):
        if candidate.exists():
            return candidate
    raise NoViewer(because("recording.viewer.no_program", folder=str(folder)))


def environment(inherited: Mapping[str, str]) -> dict[str, str]:
    """The environment of the program: without its usage statistics, which go to a server of its maker."""
    # Rerun 0.41 has no switch of its own for one process; where CI is set it collects and sends nothing.
    return {**inherited, "CI": "1", "RUST_LOG": inherited.get("RUST_LOG", "warn")}


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


def free_port(host: str = LOOPBACK) -> int:
    """A port that is free now on `host`, an address of IPv4's loopback."""
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
