"""The writer of recordings: rotation of files, and retries when the disk refuses."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from gemelo.libraries.runtime.process.own_files import own_folder
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.services.logger.core import Batch, Logger
from gemelo.services.logger.files import is_due, prune, stem_of
from gemelo.services.logger.recording import Recording


class LoggerParameters(msgspec.Struct, frozen=True, kw_only=True):
    """Folder, size, age and number of the recordings, and the room that they leave."""

    enable_logging: Annotated[bool, Meta(description="record at all")] = True
    log_dir: Annotated[str, Meta(description="folder of the recordings; empty: <paths.out>/recordings")] = ""
    max_file_mb: Annotated[float, Meta(description="[MB] a larger file is followed by a new one", gt=0)] = 256.0
    max_age_minutes: Annotated[float, Meta(description="[min] an older file is followed by a new one", gt=0)] = 60.0
    reserve_mb: Annotated[
        float,
        Meta(description="[MB] that stay free on their disk, at most a twentieth of it", ge=0),
    ] = 500.0
    image_rate: Annotated[
        float, Meta(description="images of each camera that are recorded [Hz]; 0: none", ge=0, le=60)
    ] = 2.0
    keep_files: Annotated[int, Meta(description="how many recordings are kept; 0: all", ge=0)] = 48
    keep_black_boxes: Annotated[
        int, Meta(description="how many black boxes of each kind of incident are kept; 0: none is saved", ge=0)
    ] = 20


RETRY = 2.0  # [s] between two attempts on a disk that refuses
SHARE = 20  # of a disk, one of so many parts at most is left free; chosen: a small one is of use too


class NoReserve(OSError):
    """What is free on the disk is for others."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(errno.ENOSPC, str(reason))
        self.reason = reason


@dataclass
class RecordingWriter:
    """Writes the logger's batches; an error of the disk is reported and retried, never raised."""

    robot: str
    metadata: dict[str, dict[str, str]]  # by the name of its record
    warn: Callable[[str], None]  # a warning for a person
    recording: Recording | None = field(default=None, init=False)
    problem: Reason | None = field(default=None, init=False)  # why nothing can be written at present
    files: list[Path] = field(default_factory=list, init=False)  # begun since the start
    _retry_at: float = field(default=0.0, init=False)  # [s] monotonic
    _opened_at: float = field(default=0.0, init=False)  # [s] monotonic, of the present recording

    def write(
        self, logger: Logger, batch: Batch, folder: Path, parameters: LoggerParameters, now: int, monotonic: float
    ) -> None:
        """Write `batch`, or give it back to the logger where the disk refuses.

        `now` in ns UNIX names files; ages and pauses are of `monotonic` [s], as a clock may be set back.
        """
        if monotonic < self._retry_at:
            logger.give_back(batch)
            return
        try:
            recording = self._open_recording(logger, batch, folder, parameters, now, monotonic)
            require_reserve(folder, parameters.reserve_mb)
            self._write(recording, batch)
        except OSError as error:
            logger.give_back(batch)
            if isinstance(error, NoReserve):
                self.close()  # for which there is room
            self._give_up(error, folder, monotonic)
        else:
            self._recovered(recording)

    def close(self) -> None:
        """End the present recording, if any."""
        recording, self.recording = self.recording, None
        if recording is not None:
            try:
                recording.close()
            except OSError as error:
                self.warn(f"{recording.path} could not be finished ({error}); a streaming reader still reads it")

    def _open_recording(
        self, logger: Logger, batch: Batch, folder: Path, parameters: LoggerParameters, now: int, monotonic: float
    ) -> Recording:
        if self.recording is not None and self._is_over(self.recording, folder, parameters, monotonic):
            self.close()
        if self.recording is None:
            own_folder(folder)
            stem = stem_of(self.robot, now)
            prune(
                folder, self.robot, parameters.keep_files, (*(path.stem for path in self.files), stem)
            )  # which makes room, perhaps
            require_reserve(folder, parameters.reserve_mb)
            self.recording, self._opened_at = Recording(folder, stem, self.metadata), monotonic
            self.recording.write(logger.first_entries(batch, now))
            self.files.append(self.recording.path)
        return self.recording

    def _is_over(self, recording: Recording, folder: Path, parameters: LoggerParameters, monotonic: float) -> bool:
        age = monotonic - self._opened_at
        moved = recording.path.parent != folder or not recording.path.exists()
        return moved or is_due(recording.size, age, parameters.max_file_mb, parameters.max_age_minutes)

    @staticmethod
    def _write(recording: Recording, batch: Batch) -> None:
        if batch.entries:
            recording.write(batch.entries)
        if batch.lines:
            recording.write_lines(batch.lines)

    def _give_up(self, error: OSError, folder: Path, monotonic: float) -> None:
        if self.recording is not None:
            self.recording.abandon()
            self._forget_if_empty(self.recording)
            self.recording = None
        self._retry_at = monotonic + RETRY
        why = error.reason if isinstance(error, NoReserve) else plain(error.strerror or str(error))
        problem = because("recording.unwritable", why, folder=str(folder))
        if problem != self.problem:
            remedy = "free space or set the parameter `log_dir`; tried again every 2 s, messages wait in memory"
            self.warn(f"{problem}; {remedy}")
        self.problem = problem

    def _forget_if_empty(self, recording: Recording) -> None:
        """A full disk must not gather a new empty file at every attempt."""
        if recording.path not in self.files:
            with suppress(OSError):
                recording.path.unlink()

    def _recovered(self, recording: Recording) -> None:
        if self.problem:
            self.warn(f"writing again, to {recording.path}")
        self.problem = None
        self._retry_at = 0.0


def require_reserve(folder: Path, reserve_mb: float) -> None:
    """Raises NoReserve where fewer [MB] than the reserve are free: ledger, positions and logs mostly share the disk."""
    disk = os.statvfs(folder)
    reserve = min(reserve_mb * 1e6, disk.f_blocks * disk.f_frsize / SHARE)
    if disk.f_bavail * disk.f_frsize < reserve:
        raise NoReserve(because("recording.reserve", reserve_mb=reserve / 1e6))
