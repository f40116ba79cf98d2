"""A beat that needs no disk: the name of a socket in Linux's abstract namespace, which /proc/net/unix lists.

The name is `gemelo/<16 hexadecimal digits of the run folder's SHA-256>/<process>/<state>/<time>`, with the time in
whole seconds of the clock of /proc/uptime. deploy/probe reads it where the files of the readiness are old. Who beats so
needs a new name every second; at rest there is one socket without a name, so that one can be had when the process has
no descriptor left.
"""

from __future__ import annotations

import hashlib
import os
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path

SOCKETS = Path("/proc/net/unix")


class BeatSocket:
    """The socket of one process; without effect elsewhere than on Linux."""

    def __init__(self, run_dir: Path, name: str) -> None:
        self._prefix = _prefix(run_dir, name)
        self._name = ""  # as it is shown; empty: it has none
        self._socket = _opened("")

    def __del__(self) -> None:
        self._close()

    def show(self, state: str) -> None:
        """The process is `state`, "ready" or "alive", at this moment."""
        name = f"{self._prefix}{state}/{_uptime()}"
        if name == self._name:
            return
        fresh = _opened(name)
        self._close()
        self._socket, self._name = fresh or _opened(name), name

    def hide(self) -> None:
        """The files say it again."""
        if self._name:
            self._close()
            self._socket, self._name = _opened(""), ""

    def _close(self) -> None:
        if self._socket is not None:
            self._socket.close()


def newest_beat(run_dir: Path, name: str, within: float) -> str:
    """The state that the process `name` has shown by its socket in the last `within` [s]; empty for none."""
    prefix = f"@{_prefix(run_dir, name)}"
    with suppress(OSError):
        for line in SOCKETS.read_text(encoding="utf-8", errors="replace").splitlines():
            state, _, shown = line.partition(prefix)[2].partition("/")
            if shown.isdigit() and _uptime() - int(shown) <= within:
                return state
    return ""


def _prefix(run_dir: Path, name: str) -> str:
    """deploy/probe makes the same one of the folder's name, from the folder that it runs in."""
    folder = run_dir if run_dir.is_absolute() else Path.cwd() / run_dir
    return f"gemelo/{hashlib.sha256(os.fsencode(folder)).hexdigest()[:16]}/{name}/"


def _uptime() -> int:
    return int(time.clock_gettime(time.CLOCK_BOOTTIME)) if sys.platform == "linux" else 0


def _opened(name: str) -> socket.socket | None:
    """A socket with this name, or without one; None where there is no descriptor left."""
    if sys.platform != "linux":
        return None
    try:
        opened = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    except OSError:
        return None
    if name:
        with suppress(OSError):  # another process shows the same at this second
            opened.bind(f"\0{name}")
    return opened
