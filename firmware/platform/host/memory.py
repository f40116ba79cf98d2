"""The joint positions that the virtual ESP32 stores over a restart, as a real one does in its flash.

Written at rest and once when motion starts, never while moving: so a device that finds "moving" was cut off in a
motion, and does not know where its joints are. A disk that refuses is reported and tried again; motion needs none.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import msgspec

from gemelo.libraries.runtime.process.unwritten import Attempts, UnwrittenFiles

SIZE = 1024  # [bytes] of the file, with blanks before its text: always as many, so it can be written in its own place


class StoredPosition(msgspec.Struct, frozen=True, kw_only=True):
    """The file's content."""

    device: str
    steps: tuple[int, ...]
    moving: bool
    referenced: bool
    shaft: tuple[int, ...] = ()  # where the arm truly is, which a real board does not know


class BootState(msgspec.Struct, frozen=True, kw_only=True):
    """The state that the device boots with."""

    steps: tuple[int, ...]
    shaft: tuple[int, ...]
    referenced: bool
    reset_cause: str


class PositionStore:
    """The file, and what was written last."""

    def __init__(self, path: Path, device: str, unwritten: UnwrittenFiles) -> None:
        """`unwritten` gets what the disk refuses."""
        self._path = path
        self._device = device
        self._attempts = Attempts(f"the position of {device} in {path}", unwritten)
        self._written: StoredPosition | None = None

    def wake(self, reference: tuple[int, ...]) -> BootState:
        """The boot positions: `reference` [steps] on the very first start, else the stored ones."""
        try:
            content = self._path.read_bytes()
            memory = msgspec.json.decode(content, type=StoredPosition)
        except FileNotFoundError:
            return _at(reference, "first_start")
        except (OSError, msgspec.DecodeError):
            return _lost(reference, reference, "memory_unreadable")
        if memory.device != self._device or len(memory.steps) != len(reference):
            return _at(reference, "first_start")
        shaft = memory.shaft if len(memory.shaft) == len(reference) else memory.steps
        if memory.moving:
            return _lost(reference, shaft, "lost_while_moving")
        if not self._attempts.write(lambda: _overwrite(self._path, content)):  # and so were perhaps moves since then
            return _lost(reference, shaft, "memory_unwritable")
        return BootState(steps=memory.steps, shaft=shaft, referenced=memory.referenced, reset_cause="power_on")

    def keep(self, memory: StoredPosition) -> None:
        """Remember; touches the disk only when something has changed, and never while moving.

        A disk that refuses is reported and tried again. Where not even the word that the arm moves can be written, the
        file is made empty: what it has would be taken for the arm's position after a restart.
        """
        written = self._written
        if memory == written or (written is not None and written.moving and memory.moving):
            return
        if self._attempts.write(lambda: self._write(memory)):
            self._written = memory
        elif memory.moving:
            with suppress(OSError):
                os.truncate(self._path, 0)

    def _write(self, memory: StoredPosition) -> None:
        """Replaces the file as a whole; a full disk still has the room that the file has by now."""
        content = (msgspec.json.encode(memory) + b"\n").rjust(SIZE)
        beside = self._path.with_suffix(".tmp")
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_bytes(content)
            os.replace(beside, self._path)
        except OSError as error:
            with suppress(OSError):
                beside.unlink()
            try:
                _overwrite(self._path, content)
            except FileNotFoundError:
                raise error from None


def _overwrite(path: Path, content: bytes) -> None:
    """In the file's own place, with one write; raises OSError."""
    with open(path, "r+b", buffering=0) as file:
        file.write(content)


def _at(steps: tuple[int, ...], cause: str) -> BootState:
    return BootState(steps=steps, shaft=steps, referenced=True, reset_cause=cause)


def _lost(reference: tuple[int, ...], shaft: tuple[int, ...], cause: str) -> BootState:
    return BootState(steps=(0,) * len(reference), shaft=shaft, referenced=False, reset_cause=cause)
