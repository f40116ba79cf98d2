"""A serial line between gateway and virtual device that loses and changes bytes, or is unplugged."""

from __future__ import annotations

import os
import select
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path
from random import Random

PIECE = 4096  # [B] that are read at once
LONGEST_LOSS = 64  # [B] that are lost together: chosen, half a FIFO of an UART


class NoisyLine:
    """Takes the place of the device's line at `path`, in a thread of its own, until `close`.

    `losing`, `garbling`: the shares of pieces, of up to some frames, of which a run of bytes is lost or one bit is
    changed. Raises OSError where there is no line at `path`.
    """

    def __init__(self, path: Path, seed: int = 0) -> None:
        self.losing = 0.0
        self.garbling = 0.0
        self._path, self._random = path, Random(seed)
        self._board = os.open(os.readlink(path), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._near, self._far = -1, -1
        self._turns = 0
        self._lock = threading.Lock()
        self._wake, self._asleep = os.pipe()
        self.plug()
        self._thread = threading.Thread(target=self._run, name="noisy line", daemon=True)
        self._thread.start()

    @property
    def is_running(self) -> bool:
        """True until its thread has ended."""
        return self._thread.is_alive()

    def plug(self) -> None:
        """There is a port at the path, as there was before `unplug`."""
        with self._lock:
            if self._near >= 0:
                return
            self._near, self._far = os.openpty()
            tty.setraw(self._far)
            os.set_blocking(self._near, False)
            beside = self._path.with_suffix(".noisy")
            beside.unlink(missing_ok=True)
            beside.symlink_to(os.ttyname(self._far))
            os.replace(beside, self._path)

    def unplug(self) -> None:
        """The port goes away, for who has it open too; what the board says is lost."""
        with self._lock:
            self._path.unlink(missing_ok=True)
            for end in (self._near, self._far):
                if end >= 0:
                    os.close(end)
            self._near, self._far = -1, -1
        turns = self._turns
        while self._thread.is_alive() and self._turns == turns:  # a `select` that waits for a port keeps it open
            time.sleep(0.005)

    def heal(self) -> None:
        """Everything passes as it should again."""
        self.losing, self.garbling = 0.0, 0.0
        self.plug()

    def close(self) -> None:
        """Takes the port away and ends the thread."""
        os.close(self._asleep)
        self._thread.join(5.0)
        self.unplug()
        for end in (self._board, self._wake):
            os.close(end)

    def _run(self) -> None:
        poll = 0.05  # [s] until an unplugged port that is plugged in again is read
        while True:
            self._turns += 1
            near = self._near
            ends = [self._board, self._wake, *([near] if near >= 0 else [])]
            with suppress(OSError, ValueError):  # unplugged meanwhile
                ready, _, _ = select.select(ends, [], [], poll)
                if self._wake in ready:
                    return
                self._pass(ready)

    def _pass(self, ready: list[int]) -> None:
        with self._lock:
            for source, sink in ((self._board, self._near), (self._near, self._board)):
                if source >= 0 and source in ready:
                    data = spoiled(os.read(source, PIECE), self._random, self.losing, self.garbling)
                    if sink >= 0:
                        with suppress(BlockingIOError):  # what nobody reads is lost, as on a wire
                            os.write(sink, data)


def spoiled(data: bytes, random: Random, losing: float, garbling: float) -> bytes:
    """A piece after the line: the share `losing` of pieces loses some bytes, the share `garbling` has a bit changed."""
    changed = bytearray(data)
    if changed and random.random() < losing:
        place = random.randrange(len(changed))
        del changed[place : place + random.randint(1, LONGEST_LOSS)]
    if changed and random.random() < garbling:
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)
