"""The virtual ESP32's USB: a pseudo-terminal behind a stable path."""

from __future__ import annotations

import contextlib
import os
import queue
import select
import threading
import time
import tty
from pathlib import Path

from gemelo.firmware.platform.host.link import Item, SerialBytes
from gemelo.libraries.runtime.process.unwritten import Attempts, UnwrittenFiles

MAX_READ = 4096  # [bytes] read at once


class SerialLine:
    """The device's end of the line; whoever opens `path` has the other one."""

    def __init__(self, path: Path, inbox: queue.SimpleQueue[Item], unwritten: UnwrittenFiles) -> None:
        """`unwritten` gets that the disk refuses the path, which `beat` tries again."""
        self.path = path
        self._attempts, self._is_linked = Attempts(f"the serial line's path {path}", unwritten), False
        self._inbox = inbox
        # The other end stays open here too, or reading would fail whenever nobody else has it open.
        self._device_end, self._host_end = os.openpty()
        tty.setraw(self._host_end)
        os.set_blocking(self._device_end, False)
        self._wake, self._asleep = os.pipe()
        self.beat()
        self._reader = threading.Thread(target=self._read, name="serial", daemon=True)

    def start(self) -> None:
        """Read in a thread of its own; each piece comes with its time of arrival."""
        self._reader.start()

    def write(self, data: bytes) -> None:
        """Send; what nobody reads is lost, as on a wire."""
        if data:
            with contextlib.suppress(BlockingIOError):
                os.write(self._device_end, data)

    def beat(self) -> None:
        """Makes the path, where that was not possible before."""
        self._is_linked = self._is_linked or self._attempts.write(self._link)

    def close(self) -> None:
        """Take the path away and end the thread."""
        os.close(self._asleep)
        self._reader.join(timeout=1.0)
        with contextlib.suppress(OSError):
            if os.readlink(self.path) == os.ttyname(self._host_end):
                self.path.unlink()
        for descriptor in (self._device_end, self._host_end, self._wake):
            os.close(descriptor)

    def _link(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        beside = self.path.with_suffix(".new")
        beside.unlink(missing_ok=True)
        beside.symlink_to(os.ttyname(self._host_end))
        os.replace(beside, self.path)

    def _read(self) -> None:
        while True:
            ready, _, _ = select.select([self._device_end, self._wake], [], [])
            if self._wake in ready:
                return
            with contextlib.suppress(BlockingIOError):
                self._inbox.put(SerialBytes(os.read(self._device_end, MAX_READ), time.monotonic()))
