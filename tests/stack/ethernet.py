"""A switch of Ethernet in this process: every cable loses or delays frames, in each direction for itself.

The kernel of a test machine may lack netem. A TAP device in each host's namespace is one end of a cable, this process
the other: TCP, TLS, lost acknowledgements and retransmissions are the kernel's own.
"""

from __future__ import annotations

import contextlib
import fcntl
import heapq
import os
import random
import selectors
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

TUN_SET_IFF, TAP_WITHOUT_HEADER = 0x400454CA, 0x1002  # linux/if_tun.h: TUNSETIFF; IFF_TAP | IFF_NO_PI
LONGEST_FRAME = 65_536  # [bytes]
TICK = 0.1  # [s] between two looks at whether it is to end


@dataclass(frozen=True)
class Way:
    """One direction of a cable; a frame is never overtaken by a later one of the same two hosts."""

    is_cut: bool = False
    delay: float = 0.0  # [s]
    jitter: float = 0.0  # [s] to either side of the delay, uniform

    def takes(self) -> float:
        """[s] for the next frame."""
        return self.delay + random.uniform(-self.jitter, self.jitter) if self.jitter else self.delay


OPEN, CUT = Way(), Way(is_cut=True)


class Ethernet:
    """Its cables by host; a thread forwards their frames from `__enter__` to `close`."""

    def __init__(self) -> None:
        self._cables: dict[str, int] = {}
        self._out: dict[str, Way] = {}
        self._into: dict[str, Way] = {}
        self._learned: dict[bytes, str] = {}  # host by MAC address
        self._under_way: list[tuple[float, int, str, bytes]] = []  # when [s monotonic], number, to whom, what
        self._latest: dict[tuple[str, str], float] = {}  # [s monotonic] at which the last frame of two hosts is due
        self._count = 0
        self._is_over = False
        self._thread: threading.Thread | None = None

    def plug(self, host: str, namespace: str) -> None:
        """Gives the namespace the device `eth0`, down, on a cable of its own."""
        name = f"gm{os.getpid() % 100_000}-{len(self._cables)}"
        file = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(file, TUN_SET_IFF, struct.pack("16sH", name.encode(), TAP_WITHOUT_HEADER))
        self._cables[host] = file
        self._out[host] = self._into[host] = OPEN
        subprocess.run(["ip", "link", "set", name, "netns", namespace, "name", "eth0"], check=True)

    def start(self) -> None:
        """From now on frames pass."""
        self._thread = threading.Thread(target=self._run, name="ethernet", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Unplugs every cable."""
        self._is_over = True
        if self._thread is not None:
            self._thread.join()
        for file in self._cables.values():
            os.close(file)
        self._cables.clear()

    @contextlib.contextmanager
    def impaired(self, host: str, out: Way = OPEN, into: Way = OPEN) -> Iterator[None]:
        """What the host sends goes the way `out`, what it is sent `into`, for as long as the block runs."""
        self._out[host], self._into[host] = out, into
        try:
            yield
        finally:
            self._out[host] = self._into[host] = OPEN

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector:
            for host, file in self._cables.items():
                selector.register(file, selectors.EVENT_READ, host)
            while not self._is_over:
                wait = self._under_way[0][0] - time.monotonic() if self._under_way else TICK
                for key, _ in selector.select(min(max(wait, 0.0), TICK)):
                    self._take(key.fd, key.data)
                self._deliver(time.monotonic())

    def _take(self, file: int, sender: str) -> None:
        """Reads all that a host has sent; a device that is down has nothing."""
        with contextlib.suppress(OSError):
            while frame := os.read(file, LONGEST_FRAME):
                self._learned[frame[6:12]] = sender
                known = self._learned.get(frame[:6])
                for receiver in (known,) if known is not None else self._cables:
                    if receiver != sender:
                        self._send(sender, receiver, frame)

    def _send(self, sender: str, receiver: str, frame: bytes) -> None:
        out, into = self._out[sender], self._into[receiver]
        if out.is_cut or into.is_cut:
            return
        wanted = time.monotonic() + out.takes() + into.takes()
        due = self._latest[sender, receiver] = max(wanted, self._latest.get((sender, receiver), 0.0))
        self._count += 1
        heapq.heappush(self._under_way, (due, self._count, receiver, frame))

    def _deliver(self, now: float) -> None:
        while self._under_way and self._under_way[0][0] <= now:
            _, _, receiver, frame = heapq.heappop(self._under_way)
            with contextlib.suppress(OSError):  # the device is down, or its queue is full: the frame is lost
                os.write(self._cables[receiver], frame)
