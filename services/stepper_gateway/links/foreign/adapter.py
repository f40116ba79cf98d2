"""Runs a foreign device in a thread of its own, by the clock: frames in and out, bytes to and from its wire."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from gemelo.services.stepper_gateway.links.connection import ReceiveQueue
from gemelo.services.stepper_gateway.links.foreign.stand_in import Report
from gemelo.services.stepper_gateway.links.link import Kind, Received

PAUSE = 0.005  # [s] longest wait between two looks at the clock, as a path is played; chosen: a quarter of a knot
FULL = 1024  # frames that may wait; chosen: the gateway sends some hundred a second


class ForeignDevice(Protocol):
    """A device that is given the time [s] and says what is to go over its own wire."""

    def receive(self, kind: Kind, payload: bytes, now: float) -> None:
        """A frame of the gateway's, at `now` [s] monotonic."""

    def advance(self, now: float) -> list[bytes]:
        """What is to be written at `now` [s] monotonic."""

    def take(self) -> list[Report]:
        """What the gateway is to hear."""


class ForeignCall(NamedTuple):
    """Something that came over the foreign wire, as a call on the device."""

    handle: Callable[[float], None]


class FrameFor(NamedTuple):
    """A frame of the gateway's."""

    kind: Kind
    payload: bytes


class Adapter:
    """The device's only thread; everything else may call `put` and `take`."""

    def __init__(self, device: ForeignDevice, write: Callable[[bytes], None], wake: Callable[[], None]) -> None:
        self._device, self._write = device, write
        self._inbox: queue.SimpleQueue[FrameFor | ForeignCall] = queue.SimpleQueue()
        self._received = ReceiveQueue(wake)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="foreign-device", daemon=True)
        self._thread.start()

    def put(self, item: FrameFor | ForeignCall) -> bool:
        """False: too much waits already."""
        if self._inbox.qsize() >= FULL:
            return False
        self._inbox.put(item)
        return True

    def take(self, most: int) -> list[Received]:
        """What the gateway is to hear, oldest first, at most so many."""
        return self._received.take(most)

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        while not self._stop.is_set():
            items = self._wait()
            for item in items:
                self._handle(item)
            for payload in self._device.advance(time.monotonic()):
                self._write(payload)
            arrival = time.monotonic_ns()
            said = [Received(kind, payload, False, arrival) for kind, payload in self._device.take()]
            if said:
                self._received.put(*said)

    def _wait(self) -> list[FrameFor | ForeignCall]:
        try:
            items = [self._inbox.get(timeout=PAUSE)]
        except queue.Empty:
            return []
        while not self._inbox.empty():
            items.append(self._inbox.get())
        return items

    def _handle(self, item: FrameFor | ForeignCall) -> None:
        now = time.monotonic()
        match item:
            case FrameFor(kind, payload):
                self._device.receive(kind, payload, now)
            case ForeignCall(handle):
                handle(now)
