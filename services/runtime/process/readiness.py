"""`<run>/<name>.ready`: the file by which a process says that its state is valid; `<name>.problem` says why it is not.

`<run>/<name>.alive` names the process, and is touched while its loop runs, whether its state is valid or not.
All are read by deploy/probe. Under systemd it is told too (sd_notify(3)): ready with the first valid state, and alive
with every beat, so that a process whose loop stands still is started anew, and one whose board is off is not. That
also holds before the first valid state: a start may take as long as it is said to go on.
"""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path

GOES_ON = 5  # [s] that the word for being alive counts
ALIVE = f"WATCHDOG=1\nEXTEND_TIMEOUT_USEC={GOES_ON}000000"


class Readiness:
    """A file that exists, and is touched once a second by `beat`, only while the state is valid."""

    def __init__(self, run_dir: Path, name: str) -> None:
        self._file = run_dir / f"{name}.ready"
        self._problem_file = run_dir / f"{name}.problem"
        self._alive_file = run_dir / f"{name}.alive"
        self._process = own_process()  # which may become another program, and leave its beats to a child
        self._is_ready = False
        self._problem = ""  # as its file has it
        _remove(self._file)
        _remove(self._problem_file)
        _remove(self._alive_file)

    @property
    def is_ready(self) -> bool:
        return self._is_ready

    def ready(self) -> None:
        """The state is valid from now on."""
        self._tell("")
        if not self._is_ready:
            self._is_ready = True
            self._write()
            notify("READY=1\nSTATUS=ready")

    def not_ready(self, problem: str = "") -> None:
        """The state is not valid (any more), because of `problem`; empty where there is no word for it."""
        self._tell(problem)
        if self._is_ready:
            self._is_ready = False
            _remove(self._file)
            notify("STATUS=not ready")

    def beat(self) -> None:
        """Call once a second, ready or not."""
        tell_alive()
        _touch(self._alive_file, self._process)
        if self._is_ready:
            _touch(self._file, str(os.getpid()))

    def _write(self) -> None:
        _write(self._file, str(os.getpid()))

    def _tell(self, problem: str) -> None:
        """Brings the file of the problem up to date; no process ends because that cannot be written."""
        if problem == self._problem:
            return
        self._problem = problem
        if not problem:
            return _remove(self._problem_file)
        with contextlib.suppress(OSError):
            self._problem_file.parent.mkdir(parents=True, exist_ok=True)
            self._problem_file.write_text(f"{problem}\n", encoding="utf-8")


def own_process() -> str:
    """The id of this process and, on Linux, when it started in ticks since boot (proc(5)): no other has both."""
    with contextlib.suppress(OSError):
        return f"{os.getpid()} {Path('/proc/self/stat').read_text().rpartition(')')[2].split()[19]}"
    return str(os.getpid())


def _touch(file: Path, content: str) -> None:
    try:
        os.utime(file)
    except FileNotFoundError:
        _write(file, content)


def _write(file: Path, content: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"{content}\n", encoding="ascii")


def _remove(file: Path) -> None:
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        file.unlink()


def tell_alive() -> None:
    """Tells systemd that this process is at work, and goes on with its start if it was not ready yet."""
    notify(ALIVE)


def notify(state: str) -> None:
    """Tells systemd, where it has started this process and listens."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link:
        link.sendto(state.encode(), f"\0{address[1:]}" if address.startswith("@") else address)
