"""The joint positions that the virtual ESP32 stores over a restart, as a real one does in its flash.

Written at rest and once when motion starts, never while moving: so a device that finds "moving" was cut off in a
motion, and does not know where its joints are.
"""

from __future__ import annotations

import os
from pathlib import Path

import msgspec


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

    def __init__(self, path: Path, device: str) -> None:
        self._path = path
        self._device = device
        self._written: StoredPosition | None = None

    def wake(self, reference: tuple[int, ...]) -> BootState:
        """The boot positions: `reference` [steps] on the very first start, else the stored ones."""
        try:
            memory = msgspec.json.decode(self._path.read_bytes(), type=StoredPosition)
        except FileNotFoundError:
            return _at(reference, "first_start")
        except (OSError, msgspec.DecodeError):
            return _lost(reference, reference, "memory_unreadable")
        if memory.device != self._device or len(memory.steps) != len(reference):
            return _at(reference, "first_start")
        shaft = memory.shaft if len(memory.shaft) == len(reference) else memory.steps
        if memory.moving:
            return _lost(reference, shaft, "lost_while_moving")
        return BootState(steps=memory.steps, shaft=shaft, referenced=memory.referenced, reset_cause="power_on")

    def keep(self, memory: StoredPosition) -> None:
        """Remember; touches the disk only when something has changed, and never while moving."""
        written = self._written
        if memory == written or (written is not None and written.moving and memory.moving):
            return
        beside = self._path.with_suffix(".tmp")
        beside.write_bytes(msgspec.json.encode(memory) + b"\n")
        os.replace(beside, self._path)
        self._written = memory


def _at(steps: tuple[int, ...], cause: str) -> BootState:
    return BootState(steps=steps, shaft=steps, referenced=True, reset_cause=cause)


def _lost(reference: tuple[int, ...], shaft: tuple[int, ...], cause: str) -> BootState:
    return BootState(steps=(0,) * len(reference), shaft=shaft, referenced=False, reset_cause=cause)
