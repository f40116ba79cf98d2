"""`<run>/<name>.ready`: the file by which a process says that its state is valid; `<name>.problem` says why it is not.

`<run>/<name>.alive` names the process, and is touched while its loop runs, whether its state is valid or not.
All are read by deploy/probe. No process ends because they cannot be written: a disk that is full or read-only is
reported once, tried again with every beat, and meanwhile the name of a socket says the same (beat_socket.py).

Under systemd it is told too (sd_notify(3)): ready with the first valid state, and alive with every beat, so that a
process whose loop stands still is started anew, and one whose board is off is not. That also holds before the first
valid state: a start may take as long as it is said to go on.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Callable
from pathlib import Path

from gemelo.libraries.runtime.process.beat_socket import BeatSocket, newest_beat
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles

GOES_ON = 5  # [s] that the word for being alive counts
ALIVE = f"WATCHDOG=1\nEXTEND_TIMEOUT_USEC={GOES_ON}000000"
STALE = 3.0  # [s] as deploy/probe: a process that is ready says so once a second


class Readiness:
    """A file that exists, and is touched once a second by `beat`, only while the state is valid."""

    def __init__(self, run_dir: Path, name: str, unwritten: UnwrittenFiles) -> None:
        """`unwritten` gets what cannot be written."""
        self._file = run_dir / f"{name}.ready"
        self._problem_file = run_dir / f"{name}.problem"
        self._alive_file = run_dir / f"{name}.alive"
        self._what = f"the readiness of {name} in {run_dir}"
        self._unwritten = unwritten
        self._socket = BeatSocket(run_dir, name)
        self._process = own_process()  # which may become another program, and leave its beats to a child
        self._is_ready = False
        self._problem = ""
        self._written: tuple[bool, str] | None = None  # the state and the problem that the files have
        self._try_to(self._remove_all)

    @property
    def is_ready(self) -> bool:
        return self._is_ready

    def ready(self) -> None:
        """The state is valid from now on."""
        was_ready, self._is_ready, self._problem = self._is_ready, True, ""
        if not was_ready:
            self._try_to(self._write)
            notify("READY=1\nSTATUS=ready")

    def not_ready(self, problem: str = "") -> None:
        """The state is not valid (any more), because of `problem`; empty where there is no word for it."""
        was_ready, self._is_ready = self._is_ready, False
        if was_ready or problem != self._problem:
            self._problem = problem
            self._try_to(self._write)
        if was_ready:
            notify("STATUS=not ready")

    def beat(self) -> None:
        """Call once a second, ready or not."""
        tell_alive()
        self._try_to(self._touch_all)

    def _try_to(self, write: Callable[[], None]) -> None:
        """What fails is tried again by the next beat."""
        try:
            write()
        except OSError as error:
            self._socket.show("ready" if self._is_ready else "alive")
            self._unwritten.failed(self._what, error)
        else:
            self._socket.hide()
            self._unwritten.written(self._what)

    def _touch_all(self) -> None:
        if self._written != (self._is_ready, self._problem):
            self._write()
        elif self._is_ready:
            _touch(self._file, str(os.getpid()))
        _touch(self._alive_file, self._process)

    def _write(self) -> None:
        """Brings the files of state and problem up to date."""
        if self._is_ready:
            _write(self._file, str(os.getpid()))
            _remove(self._problem_file)
        else:
            _remove(self._file)
            _write(self._problem_file, self._problem) if self._problem else _remove(self._problem_file)
        self._written = self._is_ready, self._problem

    def _remove_all(self) -> None:
        _remove(self._alive_file)
        self._write()


def says_ready(run_dir: Path, name: str) -> bool:
    """True if the process `name` has said within the last 3 s that it is ready, by its file or its socket."""
    return is_fresh(run_dir / f"{name}.ready") or newest_beat(run_dir, name, STALE) == "ready"


def is_fresh(file: Path) -> bool:
    """True if the file was touched within the last 3 s."""
    try:
        return time.time() - file.stat().st_mtime < STALE
    except OSError:
        return False


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
    """Leaves no file behind that is not whole."""
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        file.write_text(f"{content}\n", encoding="utf-8")
    except OSError:
        with contextlib.suppress(OSError):
            file.unlink()
        raise


def _remove(file: Path) -> None:
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        file.unlink()


def tell_alive() -> None:
    """Tells systemd that this process is at work, and goes on with its start if it was not ready yet."""
    notify(ALIVE)


_links: list[socket.socket] = []  # to systemd, once it was needed: later there may be no descriptor left


def notify(state: str) -> None:
    """Tells systemd, where it has started this process and listens."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    with contextlib.suppress(OSError):
        if not _links:
            _links.append(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM))
        _links[0].sendto(state.encode(), f"\0{address[1:]}" if address.startswith("@") else address)
