"""The firmware core in real time: frames in, steps made as the clock says, reports out."""

from __future__ import annotations

import json
import logging
import queue
import time

from firmware.bindings.device import Device, OutFrame
from firmware.platform.host.link import Arrived, Connected, DeviceLink, Disconnected, Item, Stop
from firmware.platform.host.memory import PoseMemory
from services.runtime.readiness import Readiness

log = logging.getLogger("virtual_esp32")

PAUSE_MOVING = 0.002  # [s] longest wait between two looks at the clock
PAUSE_AT_REST = 0.020  # [s] a state is due as often
STALL = 0.1  # [s] a loop that was late by more was stopped by the operating system
LONGEST_STOP = 5.0  # [s] when the process is asked to end while the arm moves
BEAT = 1.0  # [s] of the readiness file
PATIENCE = 3.0  # [s] that a broker which is started together with us may take


class VirtualEsp32:
    """One device on one link; everything but paho's thread happens in `run`."""

    def __init__(
        self,
        device: Device,
        link: DeviceLink,
        inbox: queue.SimpleQueue[Item],
        memory: PoseMemory,
        readiness: Readiness,
    ) -> None:
        self._device = device
        self._link = link
        self._inbox = inbox
        self._memory = memory
        self._readiness = readiness
        self._started = time.monotonic() - device.now_us / 1e6
        self._born = self._looked = time.monotonic()
        self._next_beat = 0.0
        self._connected = False
        self._was_refused = ""
        self._running = True

    def run(self) -> None:
        """Until a Stop arrives in the inbox."""
        self._remember()
        self._link.start()
        while self._running:
            self._turn()
        self._come_to_rest()
        self._readiness.not_ready()
        self._remember()
        self._link.close(offline_status(self._device))

    def _come_to_rest(self) -> None:
        """Only a device that stands knows where it will wake up."""
        self._device.halt()
        deadline = time.monotonic() + LONGEST_STOP
        while self._device.moving and time.monotonic() < deadline:
            time.sleep(PAUSE_MOVING)
            self._advance(time.monotonic())
            self._publish()

    def _turn(self) -> None:
        items = self._wait()
        now = time.monotonic()
        if now - self._looked > STALL:
            items = self._relive(items)
        else:
            self._advance(now)
        for item in items:
            self._handle(item)
        self._advance(time.monotonic())
        self._remember()
        self._publish()
        self._beat(now)

    def _wait(self) -> list[Item]:
        """Everything that has arrived, at once when there is something."""
        pause = PAUSE_MOVING if self._device.moving else PAUSE_AT_REST
        try:
            items = [self._inbox.get(timeout=pause)]
        except queue.Empty:
            return []
        while not self._inbox.empty():
            items.append(self._inbox.get())
        return items

    def _relive(self, items: list[Item]) -> list[Item]:
        """After a stall of the whole process, spread what waited in the socket over the time that was missed.

        A board does not stop with our process: it would have had each frame when it came.
        """
        time.sleep(0.01)
        while not self._inbox.empty():
            items.append(self._inbox.get())
        begin, end = self._looked, time.monotonic()
        log.warning("the operating system kept us waiting for %.0f ms", (end - begin) * 1e3)
        spread = []
        for index, item in enumerate(items):
            if isinstance(item, Arrived):
                due = begin + (end - begin) * (index + 1) / (len(items) + 1)
                item = Arrived(item.payload, item.retained, min(item.monotonic, due))
            spread.append(item)
        return spread

    def _handle(self, item: Item) -> None:
        match item:
            case Arrived():
                self._advance(item.monotonic)
                self._device.receive(item.payload, item.retained, self._device_time(item.monotonic))
            case Connected():
                self._connected, self._was_refused = True, ""
                log.info("connected to the broker")
                self._device.report_status()
            case Disconnected():
                self._on_lost(item.reason)
            case Stop():
                self._running = False

    def _on_lost(self, reason: str) -> None:
        if self._connected:
            log.warning("lost the broker (%s); trying again", reason)
            self._readiness.not_ready()
            self._connected = False
        elif reason != self._was_refused and time.monotonic() - self._born > PATIENCE:
            log.warning("no connection: %s", reason)
            self._was_refused = reason

    def _device_time(self, monotonic: float) -> int:
        return max(0, int((monotonic - self._started) * 1e6))

    def _advance(self, monotonic: float) -> None:
        self._device.advance(self._device_time(monotonic))
        self._looked = max(self._looked, monotonic)

    def _publish(self) -> None:
        """What is said while there is no broker is lost: state and status come again."""
        for frame in self._device.take():
            if frame.kind == "event":
                _log_event(frame)
            if self._connected:
                self._link.publish(frame.kind, frame.payload)

    def _remember(self) -> None:
        device = self._device
        self._memory.keep(device.steps, device.moving, device.referenced)

    def _beat(self, now: float) -> None:
        if now < self._next_beat or not self._connected:
            return
        self._next_beat = now + BEAT
        self._readiness.ready()
        self._readiness.beat()


def offline_status(device: Device) -> bytes:
    """The last will, and the farewell."""
    return json.dumps({"online": False, "device": device.config.name, "boot_id": device.boot_id}).encode()


def _log_event(frame: OutFrame) -> None:
    event = json.loads(frame.payload)
    if event["event"] in ("fault", "hold", "underrun"):
        level = logging.INFO if event["detail"] == "command" else logging.WARNING
        log.log(level, "%s %s at %.3f s", event["event"], event["detail"], event["t_us"] / 1e6)
