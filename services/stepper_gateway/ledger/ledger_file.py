"""The file of the ledger: JSON, replaced as a whole, so that a crash leaves the old one or the new one.

It is written by a thread of its own: a slow disk must not delay the heartbeat.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path

import msgspec

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.process.own_files import own_file
from gemelo.libraries.runtime.process.unwritten import RETRY, UnwrittenFiles
from gemelo.services.stepper_gateway.ledger.confidence import LedgerRecord

LAST_WRITE = 2.0  # [s] that the end of the process waits for the disk; chosen: process-compose waits longer
UNKEPT = "the step ledger, without which no joint counts as verified after a restart,"


def read_ledger(path: Path) -> tuple[LedgerRecord | None, str]:
    """The record, and what is wrong with the file; (None, "") where there is none yet."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=LedgerRecord), ""
    except FileNotFoundError:
        return None, ""
    except (OSError, msgspec.DecodeError, UnicodeDecodeError) as error:
        return None, f"{path} cannot be read ({error}): no joint counts as verified; `gemelo verify` starts it anew"


def write_ledger(path: Path, record: LedgerRecord, is_durable: bool = True) -> None:
    """Replaces the file; raises OSError and leaves the old one where that cannot be. `is_durable`: even if the power
    fails just after."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_suffix(".new")
    with open(fresh, "wb", opener=own_file) as file:
        file.write(msgspec.json.format(msgspec.json.encode(record), indent=1))
        file.flush()
        if is_durable:
            os.fsync(file.fileno())
    fresh.replace(path)


class LedgerFile:
    """Writes the newest record that it was given; of two that come while the disk is busy only the second."""

    def __init__(self, run: Path, robot: str, unwritten: UnwrittenFiles, clock: Clock = SYSTEM) -> None:
        """`unwritten` gets what the disk refuses, which is tried again every RETRY until there is a newer record.

        In virtual time there is no thread: a disk takes none of it.
        """
        self.path = run / f"{robot}.ledger.json"
        self._unwritten = unwritten
        self._news = threading.Condition()
        self._record: LedgerRecord | None = None
        self._is_open = True
        self._thread: threading.Thread | None = None
        if not clock.is_virtual:
            self._thread = threading.Thread(target=self._run, name="ledger", daemon=True)
            self._thread.start()

    def keep(self, record: LedgerRecord | None) -> None:
        """Have it written soon; None is nothing to write."""
        if self._thread is None:
            if record is not None:
                self._write(record)
            return
        with self._news:
            self._record = record
            self._news.notify()

    def close(self) -> None:
        """Returns when the last record is written or refused, at the latest after LAST_WRITE."""
        with self._news:
            self._is_open = False
            self._news.notify()
        if self._thread is not None:
            self._thread.join(LAST_WRITE)

    def _run(self) -> None:
        refused: LedgerRecord | None = None
        while True:
            with self._news:
                self._news.wait_for(
                    lambda: self._record is not None or not self._is_open, None if refused is None else RETRY
                )
                record, self._record = self._record or refused, None
                is_last = not self._is_open
            if record is not None:
                refused = None if self._write(record) else record
            if is_last:
                return

    def _write(self, record: LedgerRecord) -> bool:
        try:
            write_ledger(self.path, record, is_durable=self._thread is not None)
        except OSError as error:
            self._unwritten.failed(UNKEPT, error)
            return False
        self._unwritten.written(UNKEPT)
        return True
