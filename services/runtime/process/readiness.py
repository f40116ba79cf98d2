"""`<run>/<name>.ready`: the file by which a process says that its state is valid. Read by deploy/probe."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


class Readiness:
    """A file that exists, and is touched once a second by `beat`, only while the state is valid."""

    def __init__(self, run_dir: Path, name: str) -> None:
        self._file = run_dir / f"{name}.ready"
        self._is_ready = False
        self._remove()

    @property
    def is_ready(self) -> bool:
        return self._is_ready

    def ready(self) -> None:
        """The state is valid from now on."""
        if not self._is_ready:
            self._is_ready = True
            self._write()

    def not_ready(self) -> None:
        """The state is not valid (any more)."""
        if self._is_ready:
            self._is_ready = False
            self._remove()

    def beat(self) -> None:
        """Call once a second; does nothing while not ready."""
        if not self._is_ready:
            return
        try:
            os.utime(self._file)
        except FileNotFoundError:
            self._write()

    def _write(self) -> None:
        self._file.parent.mkdir(parents=True, exist_ok=True)
        self._file.write_text(f"{os.getpid()}\n", encoding="ascii")

    def _remove(self) -> None:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            self._file.unlink()
