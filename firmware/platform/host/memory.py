"""What the virtual ESP32 remembers over a restart, as a real one does in its flash.

Written at rest and once when motion starts, never while moving: so a device that finds "moving" was cut off in a
motion, and does not know where its joints are.
"""

from __future__ import annotations

import os
from pathlib import Path

import msgspec


class Memory(msgspec.Struct, frozen=True, kw_only=True):
    """The file's content."""

    device: str
    steps: tuple[int, ...]
    moving: bool
    referenced: bool


class Awakening(msgspec.Struct, frozen=True, kw_only=True):
    """How the device starts."""

    steps: tuple[int, ...]
    referenced: bool
    reset_cause: str


class PoseMemory:
    """The file, and what was written last."""

    def __init__(self, path: Path, device: str) -> None:
        self._path = path
        self._device = device
        self._written: Memory | None = None

    def wake(self, reference: tuple[int, ...]) -> Awakening:
        """Where the joints are: at `reference` [steps] on the very first start, else where they were left."""
        try:
            memory = msgspec.json.decode(self._path.read_bytes(), type=Memory)
        except FileNotFoundError:
            return Awakening(steps=reference, referenced=True, reset_cause="first_start")
        except (OSError, msgspec.DecodeError):
            return Awakening(steps=(0,) * len(reference), referenced=False, reset_cause="memory_unreadable")
        if memory.device != self._device or len(memory.steps) != len(reference):
            return Awakening(steps=reference, referenced=True, reset_cause="first_start")
        if memory.moving:
            return Awakening(steps=(0,) * len(reference), referenced=False, reset_cause="lost_while_moving")
        return Awakening(steps=memory.steps, referenced=memory.referenced, reset_cause="power_on")

    def keep(self, steps: tuple[int, ...], moving: bool, referenced: bool) -> None:
        """Remember; touches the disk only when something has changed, and never while moving."""
        written = self._written
        if written is not None and written.moving and moving:
            return
        memory = Memory(device=self._device, steps=steps, moving=moving, referenced=referenced)
        if memory == written:
            return
        beside = self._path.with_suffix(".tmp")
        beside.write_bytes(msgspec.json.encode(memory) + b"\n")
        os.replace(beside, self._path)
        self._written = memory
