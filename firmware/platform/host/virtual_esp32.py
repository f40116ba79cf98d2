"""A board in real time: what arrives goes in, steps are made as the clock says, reports go out."""

from __future__ import annotations

import json
import logging
import queue
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from firmware.bindings.device import OutFrame
from firmware.bindings.press import PressRefused, press, read_press, within
from firmware.platform.host.board import Board
from firmware.platform.host.clock import DeviceClock
from firmware.platform.host.link import Arrived, Connected, Disconnected, Item, Stop
from firmware.platform.host.network import Network
from schemas.device import PressKind, PressRequest
from services.runtime.readiness import Readiness

log = logging.getLogger("virtual_esp32")

PAUSE_MOVING = 0.002  # [s] longest wait between two looks at the clock
PAUSE_AT_REST = 0.020  # [s] a state is due as often
STALL = 0.1  # [s] a loop that was late by more was stopped by the operating system
LONGEST_STOP = 5.0  # [s] when the process is asked to end while the arm moves
BEAT = 1.0  # [s] of the readiness file
SHAFT_PERIOD = 0.1  # [s]
LARGEST_DRIFT = 10_000.0  # [ppm]
LONGEST_OFFLINE = 3600.0  # [s]
LOUD = ("fault", "estop", "hold", "underrun")
QUIET = ("homed", "configured", "pressed", "press_refused")


class VirtualEsp32:
    """One board on its network; everything but paho's thread happens in `run`."""

    def __init__(self, board: Board, network: Network, inbox: queue.SimpleQueue[Item], readiness: Readiness) -> None:
        self._board = board
        self._network = network
        self._inbox = inbox
        self._readiness = readiness
        self._device = board.boot()
        self._born = self._looked = time.monotonic()
        self._clock = DeviceClock(self._looked)
        self._next_beat = self._next_shaft = 0.0
        self._running = True

    def run(self) -> None:
        """Until a Stop arrives in the inbox."""
        self._announce()
        self._join()
        while self._running:
            self._turn()
        self._come_to_rest()
        self._readiness.not_ready()
        self._board.remember(self._device)
        self._network.leave()

    def _come_to_rest(self) -> None:
        """Only a device that stands knows where it will wake up."""
        self._device.halt()
        deadline = time.monotonic() + LONGEST_STOP
        while self._device.moving and time.monotonic() < deadline:
            time.sleep(PAUSE_MOVING)
            self._advance(time.monotonic())
            self._publish(time.monotonic())

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
        self._board.remember(self._device)
        self._publish(now)
        self._beat(now)
        if self._network.is_due_back(now):
            self._join()

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
                item = replace(item, monotonic=min(item.monotonic, due))
            spread.append(item)
        return spread

    def _handle(self, item: Item) -> None:
        match item:
            case Arrived():
                self._take_in(item)
            case Connected():
                self._network.on_connected()
                self._device.report_status()
            case Disconnected():
                self._network.on_disconnected(item.reason)
                self._readiness.not_ready()
            case Stop():
                self._running = False

    def _take_in(self, item: Arrived) -> None:
        self._advance(item.monotonic)
        received_us = self._clock.at(item.monotonic)
        match item.kind:
            case "press":
                if not item.retained:
                    self._press(item.payload)
            case "config":
                self._device.receive_config(item.payload, item.retained, received_us)
            case _:
                self._device.receive(item.payload, item.retained, received_us)

    def _press(self, text: bytes) -> None:
        """A press is answered by an event, whatever comes of it."""
        try:
            request = read_press(text)
            after = self._carry_out(request)
        except PressRefused as error:
            self._say_event("press_refused", str(error))
            return
        self._say_event("pressed", f"{request.press} {request.target} {request.value:g}".replace("  ", " "))
        if after is not None:
            after()

    def _carry_out(self, request: PressRequest) -> Callable[[], None] | None:
        """Do it; what would keep the answer from being said is returned, to be done after it."""
        match request.press:
            case PressKind.REBOOT:
                return partial(self._reboot, "reset_button")
            case PressKind.OFFLINE:
                return partial(self._network.break_off, within(request, LONGEST_OFFLINE))
            case PressKind.DRIFT:
                self._clock.drift(time.monotonic(), within(request, LARGEST_DRIFT, -LARGEST_DRIFT))
            case _:
                press(self._device, request)
        return None

    def _reboot(self, cause: str) -> None:
        self._network.break_off()
        self._board.remember(self._device)
        self._device = self._board.boot(cause)
        self._clock.restart(time.monotonic())
        self._announce()
        self._join()

    def _join(self) -> None:
        self._network.join(self._device, self._board.device_name, self._board.credentials)

    def _announce(self) -> None:
        self._board.remember(self._device)
        device = self._device
        joints = zip(device.config.joints, device.steps, strict=True)
        where = "at " + ", ".join(f"{joint.name} {count}" for joint, count in joints)
        lost = "position unknown: `gemelo home` finds it, `gemelo reference` declares it"
        log.info("device %s, boot %08x: %s", self._board.name, device.boot_id, where if device.referenced else lost)

    def _advance(self, monotonic: float) -> None:
        self._device.advance(self._clock.at(monotonic))
        self._looked = max(self._looked, monotonic)

    def _publish(self, now: float) -> None:
        for frame in self._device.take():
            self._say(frame)
        if now >= self._next_shaft:
            self._next_shaft = now + SHAFT_PERIOD
            self._say(OutFrame("shaft", self._device.shaft_report()))

    def _say(self, frame: OutFrame) -> None:
        if frame.kind == "event":
            _log_event(frame)
        self._network.publish(frame)

    def _say_event(self, name: str, detail: str) -> None:
        """As the firmware says its own; this one is the world's."""
        event = {"event": name, "t_us": self._device.now_us, "boot_id": self._device.boot_id, "stream": 0}
        self._say(OutFrame("event", json.dumps({**event, "detail": detail}).encode()))

    def _beat(self, now: float) -> None:
        if now < self._next_beat or not self._network.is_connected:
            return
        self._next_beat = now + BEAT
        self._readiness.ready()
        self._readiness.beat()


def _log_event(frame: OutFrame) -> None:
    event = json.loads(frame.payload)
    if event["event"] in LOUD:
        level = logging.INFO if event["detail"] == "command" else logging.WARNING
        log.log(level, "%s %s at %.3f s", event["event"], event["detail"], event["t_us"] / 1e6)
    elif event["event"] in QUIET:
        log.info("%s %s", event["event"], event["detail"])
