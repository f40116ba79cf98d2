"""A small disk of one's own at a folder, which can be filled and made read-only: a tmpfs, which only root may mount."""

from __future__ import annotations

import os
import subprocess
from contextlib import suppress
from pathlib import Path
from types import TracebackType

SIZE = 16 << 20  # [bytes] chosen: more than the files of a run have, and full at once
BALLAST = "ballast"


class NoDisk(Exception):
    """The disk cannot be mounted or made read-only; the text says why."""


def may_mount() -> bool:
    """True if this user may mount a disk."""
    return os.geteuid() == 0


class SmallDisk:
    """Mounted at `folder`, which it makes, from entering to leaving; raises `NoDisk`."""

    def __init__(self, folder: Path, size: int = SIZE) -> None:
        """`size` in [bytes]."""
        self._folder, self._size = folder, size

    def __enter__(self) -> SmallDisk:
        self._folder.mkdir(parents=True, exist_ok=True)
        _run("mount", "-t", "tmpfs", "-o", f"size={self._size}", "tmpfs", str(self._folder))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(NoDisk):
            _run("umount", "--lazy", str(self._folder))

    def fill(self) -> None:
        """No file gets another page from now on."""
        with suppress(OSError), (self._folder / BALLAST).open("ab", buffering=0) as file:
            while file.write(bytes(4096)):
                pass

    def free(self) -> None:
        """There is room again."""
        (self._folder / BALLAST).unlink(missing_ok=True)

    def make_read_only(self) -> None:
        """As Linux does with a disk that fails; raises `NoDisk` where a file on it is open for writing."""
        _run("mount", "-o", "remount,ro", str(self._folder))

    def make_writable(self) -> None:
        """As it was."""
        _run("mount", "-o", "remount,rw", str(self._folder))


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise NoDisk(f"{' '.join(command)}: {done.stderr.strip()}")
