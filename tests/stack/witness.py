"""`gemelo-virtual-esp32` with a witness on its motors: the counters at the end of every slot go to $GEMELO_SLOTS.

Only slots with a step are written; the witness is the device's own process, so no link has any part in it.
"""

from __future__ import annotations

import os
import struct
import sys
from pathlib import Path

from firmware.bindings.device import Device
from firmware.platform.host import main as virtual_esp32

SLOT = 1000  # [us]
JOINTS = 8  # columns of counters; the last ones are 0 where there are fewer
ROW = struct.Struct(f"<qQ{JOINTS}i")  # [us] device time, boot id, [steps]
STOOD = 1 << 40  # as a boot id: the operating system gave the device no time, and its motors stood


class Witness:
    """Writes a row for every slot in which a counter changed."""

    def __init__(self, path: str) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        self._last: tuple[int, ...] = ()
        self._advance, self._stand_still = Device.advance, Device.stand_still

    def advance(self, device: Device, until_us: int) -> None:
        rows = b""
        while (now := device.now_us) < until_us:
            self._advance(device, min((now // SLOT + 1) * SLOT, until_us))
            if device.now_us % SLOT == 0 and device.steps != self._last:
                self._last = device.steps
                rows += row(device.now_us, device.boot_id, self._last)
        if rows:
            os.write(self._file, rows)

    def stand_still(self, device: Device, until_us: int) -> None:
        os.write(self._file, row(device.now_us, STOOD, device.steps))
        self._stand_still(device, until_us)


def row(time_us: int, boot_id: int, steps: tuple[int, ...]) -> bytes:
    return ROW.pack(time_us, boot_id, *steps, *(0,) * (JOINTS - len(steps)))


def main() -> int:
    witness = Witness(os.environ["GEMELO_SLOTS"])
    Device.advance = lambda device, until_us: witness.advance(device, until_us)
    Device.stand_still = lambda device, until_us: witness.stand_still(device, until_us)
    return virtual_esp32.main([])


def size(path: Path) -> int:
    """Rows so far [bytes]."""
    return path.stat().st_size if path.exists() else 0


if __name__ == "__main__":
    sys.exit(main())
