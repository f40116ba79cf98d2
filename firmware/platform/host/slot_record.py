"""The counters of a virtual board at the end of every slot with a step, in a file: for who judges its motion.

`gemelo-virtual-esp32` writes it where $GEMELO_SLOTS names one. The writer is the device's own process, so that no link
has any part in what it says.
"""

from __future__ import annotations

import os
import struct
from contextlib import suppress

from gemelo.firmware.bindings.device import CoreDevice

VARIABLE = "GEMELO_SLOTS"
SLOT = 1000  # [us]
JOINTS = 8  # columns of counters; the last ones are 0 where there are fewer
ROW = struct.Struct(f"<qQ{JOINTS}i")  # [us] device time, boot id, [steps]
STOOD = 1 << 40  # as a boot id: the operating system gave the device no time, and its motors stood


class SlotRecord:
    """Lets a device's time pass, and appends a row for every slot in which a counter has changed."""

    def __init__(self, path: str) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        self._last: tuple[int, ...] = ()
        self._waiting = b""  # what the disk has not taken yet

    def advance(self, device: CoreDevice, until_us: int) -> None:
        """As the device's own, slot by slot."""
        rows = b""
        while (now := device.now_us) < until_us:
            device.advance(min((now // SLOT + 1) * SLOT, until_us))
            if device.now_us % SLOT == 0 and device.steps != self._last:
                self._last = device.steps
                rows += row(device.now_us, device.boot_id, self._last)
        self._append(rows)

    def stand_still(self, device: CoreDevice, until_us: int) -> None:
        """As the device's own, with a row that says so."""
        self._append(row(device.now_us, STOOD, device.steps))
        device.stand_still(until_us)

    def _append(self, rows: bytes) -> None:
        self._waiting += rows
        with suppress(OSError):
            while self._waiting:
                self._waiting = self._waiting[os.write(self._file, self._waiting) :]


def row(time_us: int, boot_id: int, steps: tuple[int, ...]) -> bytes:
    """One row; `steps` by joint, at the end of a slot."""
    return ROW.pack(time_us, boot_id, *steps, *(0,) * (JOINTS - len(steps)))
