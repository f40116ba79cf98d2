"""The file of the ledger: JSON, replaced as a whole, so that a crash leaves the old one or the new one.

It is written by a thread of its own: a slow disk must not delay the heartbeat.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path

import msgspec

from services.stepper_gateway.ledger.record import LedgerRecord

LAST_WRITE = 2.0  # [s] that the end of the process waits for the disk; chosen: process-compose waits longer
UNKEPT = "the step ledger cannot be kept ({}): after a restart no joint counts as verified; make room on the disk"


def read_ledger(path: Path) -> tuple[LedgerRecord | None, str]:
    """The record, and what is wrong with the file; (None, "") where there is none yet."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=LedgerRecord), ""
    except FileNotFoundError:
        return None, ""
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        return None, f"{path} cannot be read ({error}): no joint counts as verified; `gemelo verify` starts it anew"


def write_ledger(path: Path, record: LedgerRecord) -> None:
    """Replaces the file; raises OSError and leaves the old one where that cannot be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(".new")
    with fresh.open("wb") as file:
        file.write(msgspec.json.format(msgspec.json.encode(record), indent=1))
        file.flush()
        os.fsync(file.fileno())
    fresh.replace(path)


class LedgerFile:
    """Writes the newest record that it was given; of two that come while the disk is busy only the second."""

    def __init__(self, run: Path, robot: str, complain: Callable[[str], object]) -> None:
        """`complain` is called from the thread, once for each reason for which it cannot be written."""
        self.path = run / f"{robot}.ledger.json"
        self._complain, self._trouble = complain, ""
        self._news = threading.Condition()
        self._record: LedgerRecord | None = None
        self._is_open = True
        self._thread = threading.Thread(target=self._run, name="ledger", daemon=True)
        self._thread.start()

    def keep(self, record: LedgerRecord | None) -> None:
        """Have it written soon; None is nothing to write."""
        with self._news:
            self._record = record
            self._news.notify()

    def close(self) -> None:
        """Returns when the last record is written, at the latest after LAST_WRITE."""
        with self._news:
            self._is_open = False
            self._news.notify()
        self._thread.join(LAST_WRITE)

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: self._record is not None or not self._is_open)
                record, self._record = self._record, None
            if record is None:
                return
            self._write(record)

    def _write(self, record: LedgerRecord) -> None:
        try:
            write_ledger(self.path, record)
            self._trouble = ""
        except OSError as error:
            if str(error) != self._trouble:
                self._trouble = str(error)
                self._complain(UNKEPT.format(error))
