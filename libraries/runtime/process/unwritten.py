"""The files that a process could not write: reported once for each change, and kept for whoever asks."""

from __future__ import annotations

import errno
import threading
import time
from collections.abc import Callable

from gemelo.schemas.reasons import Remedy, because, remedy

RETRY = 1.0  # [s] chosen: a disk with room again is used soon, one that refuses costs nothing
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NO_DESCRIPTOR = (errno.EMFILE, errno.ENFILE)
NO_RIGHT = (errno.EACCES, errno.EPERM)


def remedy_for(error: OSError) -> Remedy:
    """What a person can do so that the file can be written."""
    if error.errno in NO_ROOM:
        return remedy("disk_room")
    if error.errno == errno.EROFS:
        return remedy("disk_read_only")
    if error.errno in NO_DESCRIPTOR:
        return remedy("disk_descriptors")
    return remedy("disk_right") if error.errno in NO_RIGHT else remedy("disk_folder")


def remedy_of(error: OSError) -> str:
    """The same as an English sentence."""
    return str(because(remedy_for(error).code))


class UnwrittenFiles:
    """By what it is, why it cannot be written; `report` gets a sentence when that begins and when it ends."""

    def __init__(self, report: Callable[[str], object]) -> None:
        self._report = report
        self._reasons: dict[str, str] = {}
        self._lock = threading.Lock()

    @property
    def sentence(self) -> str:
        """All that cannot be written now, with the remedies; empty where there is nothing."""
        with self._lock:
            return "; ".join(self._reasons.values())

    def failed(self, what: str, error: OSError) -> None:
        """`what` cannot be written, and is tried again later."""
        reason = f"{what} cannot be written ({error.strerror or error}): {remedy_of(error)}"
        with self._lock:
            is_known, self._reasons[what] = what in self._reasons, reason
        if not is_known:
            self._report(f"{reason}; it is tried again")

    def written(self, what: str) -> None:
        """`what` is written (again)."""
        with self._lock:
            was_unwritten = self._reasons.pop(what, None) is not None
        if was_unwritten:
            self._report(f"{what} can be written again")


class Attempts:
    """The writes of one file by a loop that goes on where they fail: tried again RETRY after a failure."""

    def __init__(self, what: str, unwritten: UnwrittenFiles) -> None:
        self._what, self._unwritten = what, unwritten
        self._next = 0.0  # [s] monotonic

    def write(self, write: Callable[[], object]) -> bool:
        """True if `write` was called and has raised no OSError."""
        if time.monotonic() < self._next:
            return False
        try:
            write()
        except OSError as error:
            self._next = time.monotonic() + RETRY
            self._unwritten.failed(self._what, error)
            return False
        self._next = 0.0
        self._unwritten.written(self._what)
        return True
