"""A virtual board: receives frames, advances the firmware by the clock, sends reports."""

from __future__ import annotations

import logging
import queue
from collections.abc import Callable
from functools import partial

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.frames import PlatformRequest
from gemelo.firmware.bindings.injection import InjectRefused, inject, read_injection, within
from gemelo.firmware.bindings.parsers import ProvisionRefused
from gemelo.firmware.platform.host.board import Board, DeviceClock, provision, provision_answer
from gemelo.firmware.platform.host.link import (
    Connected,
    Denied,
    Disconnected,
    Item,
    MqttMessage,
    SerialBytes,
    ShutdownRequested,
)
from gemelo.firmware.platform.host.slot_record import SlotRecord
from gemelo.firmware.platform.host.wires import Wires, say_event
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import remedy_of
from gemelo.libraries.runtime.serial_frames import JsonFrame
from gemelo.schemas.device import InjectKind, InjectRequest

log = logging.getLogger("virtual_esp32")

PAUSE_MOVING = 0.002  # [s] longest wait between two looks at the clock
PAUSE_AT_REST = 0.020  # [s] a state is due as often
STALL = 0.1  # [s] a loop that was late by more was stopped by the operating system
LAST_SLOTS = 2000  # [us] that run after a stall: one slot, and what is begun of the next
LONGEST_STOP = 5.0  # [s] when the process is asked to end while the arm moves
BEAT = 1.0  # [s] of the readiness file
TRIAL = 30.0  # [s] that a new firmware has to say status to somebody
REPLY_TIME = 0.1  # [s] that an answer has to leave, before the wire is lost
REJOIN = 1.0  # [s] between two attempts where the process has no descriptor for it
LARGEST_DRIFT = 10_000.0  # [ppm]
LONGEST_OFFLINE = 3600.0  # [s]
Passing = Callable[[CoreDevice, int], None]  # lets the device's time pass, up to then [us]


class VirtualEsp32:
    """One board on its wires; everything but their threads happens in `run`."""

    def __init__(
        self,
        board: Board,
        wires: Wires,
        inbox: queue.SimpleQueue[Item],
        readiness: Readiness,
        record: SlotRecord | None = None,
        clock: Clock = SYSTEM,
    ) -> None:
        self._time = clock
        self._advance_device: Passing = CoreDevice.advance if record is None else record.advance
        self._stand_still: Passing = CoreDevice.stand_still if record is None else record.stand_still
        self._board = board
        self._wires = wires
        self._inbox = inbox
        self._readiness = readiness
        self._device = self._boot()
        self._advanced_to = self._time.monotonic()
        self._clock = DeviceClock(self._advanced_to)
        self._next_beat = 0.0
        self._later: list[tuple[float, Callable[[], None]]] = []  # [s] when, and what
        self._running = True

    def run(self) -> None:
        """Until a ShutdownRequested arrives in the inbox."""
        self.begin()
        while self._running:
            self.turn(self._wait())
        self._stop_motion()
        self._readiness.not_ready()
        self._board.remember(self._device)
        self._wires.close()

    def _stop_motion(self) -> None:
        """Stops the motion, because the positions are valid over a restart only at rest."""
        self._device.halt()
        deadline = self._time.monotonic() + LONGEST_STOP
        while self._device.moving and self._time.monotonic() < deadline:
            self._time.sleep(PAUSE_MOVING)
            self._advance(self._time.monotonic())
            self._wires.publish(self._device, self._time.monotonic())

    def begin(self) -> None:
        """Says where the arm stands, and joins the network."""
        self._announce()
        self._join()
        self._wires.listen()

    def turn(self, items: list[Item]) -> None:
        """Lets the board's time pass up to now, with what has arrived."""
        now = self._time.monotonic()
        self._advance(now)
        for item in items:
            self._handle(item)
        self._advance(self._time.monotonic())
        self._board.remember(self._device)
        has_told = self._wires.publish(self._device, now)
        if self._device.subscribes_anew():
            self._wires.network.subscribe_anew()
        self._look_after_firmware(now, has_told)
        self._beat(now)
        self._do_what_is_due(now)

    def _look_after_firmware(self, now: float, has_told: bool) -> None:
        """Ends the trial of a new firmware, one way or the other, or restarts into one at rest and disarmed."""
        if self._board.is_on_trial and has_told:
            self._board.is_on_trial = False
            self._board.firmware.confirm()
        elif self._board.is_on_trial and now > self._booted + TRIAL:
            self._start_anew("trial_over")  # whom nobody has heard, nobody has moved
        elif self._device.still and self._board.firmware.is_ready and not self._device.armed:
            self._board.firmware.is_ready = False
            self._later.append((now + REPLY_TIME, partial(self._start_anew, "update")))

    def _do_what_is_due(self, now: float) -> None:
        due = [action for when, action in self._later if when <= now]
        self._later = [each for each in self._later if each[0] > now]
        for action in due:
            action()

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

    def _handle(self, item: Item) -> None:
        match item:
            case MqttMessage():
                self._receive(item)
            case SerialBytes():
                self._advance(item.monotonic)
                self._device.receive_serial(item.data, self._clock.at(item.monotonic))
                for request in self._device.take_requests():
                    self._on_request(request)
            case Connected():
                self._wires.network.on_connected()
                self._device.report_status()
            case Disconnected():
                self._wires.network.on_disconnected(item.reason)
                self._readiness.not_ready(f"no connection to the broker: {item.reason}")
            case Denied():
                self._wires.network.on_denied(item.reason)
            case ShutdownRequested():
                self._running = False

    def _receive(self, item: MqttMessage) -> None:
        self._advance(item.monotonic)
        received_us = self._clock.at(item.monotonic)
        match item.kind:
            case "inject":
                if not item.retained:
                    self._inject(item.payload)
            case "config":
                self._device.receive_config(item.payload, item.retained, received_us)
            case _:
                self._device.receive(item.payload, item.retained, received_us)

    def _on_request(self, request: PlatformRequest) -> None:
        if request.kind is JsonFrame.INJECT:
            self._inject(request.text)
        else:
            self._provision(request.text)

    def _provision(self, text: bytes) -> None:
        """Credentials, or a factory reset, over the serial line; the device starts anew with them."""
        try:
            cause = provision(self._board, self._device, text)
        except ProvisionRefused as error:
            self._device.say(JsonFrame.PROVISION_ACK, provision_answer(str(error)))
            return
        self._device.say(JsonFrame.PROVISION_ACK, provision_answer())
        self._start_anew(cause)

    def _inject(self, text: bytes) -> None:
        """Carries out an injection; an event answers it in any case."""
        try:
            request = read_injection(text)
            self._carry_out(request)
        except InjectRefused as error:
            say_event(self._device, "inject_refused", str(error))
        else:
            words = (request.kind, request.target, f"{request.value:g}")
            say_event(self._device, "injected", " ".join(word for word in words if word))

    def _carry_out(self, request: InjectRequest) -> None:
        """Do it; what keeps the answer from being said is done a little later."""
        now = self._time.monotonic()
        match request.kind:
            case InjectKind.REBOOT:
                self._later.append((now + REPLY_TIME, partial(self._reboot, "reset_button")))
            case InjectKind.OFFLINE:
                away = within(request, LONGEST_OFFLINE)
                self._later.append((now + REPLY_TIME, self._wires.network.break_off))
                self._later.append((now + REPLY_TIME + away, self._join))
            case InjectKind.DRIFT:
                self._clock.drift(now, within(request, LARGEST_DRIFT, -LARGEST_DRIFT))
            case _:
                inject(self._device, request)

    def _reboot(self, cause: str) -> None:
        self._board.remember(self._device)
        self._start_anew(cause)

    def _start_anew(self, cause: str) -> None:
        self._wires.publish(self._device, self._time.monotonic())
        self._later.clear()
        before, self._device = self._device, self._boot(cause)
        self._device.inherit_environment(before)
        self._clock.restart(self._time.monotonic())
        self._announce()
        self._join()

    def _boot(self, cause: str = "") -> CoreDevice:
        device = self._board.boot(cause)
        self._booted = self._time.monotonic()
        self._wires.attach(device)
        return device

    def _join(self) -> None:
        try:
            self._wires.network.join(self._device, self._board.device_name, self._board.credentials)
        except OSError as error:
            log.warning("the network cannot be joined (%s): %s; it is tried again", error, remedy_of(error))
            self._later.append((self._time.monotonic() + REJOIN, self._join))

    def _announce(self) -> None:
        self._board.remember(self._device)
        device = self._device
        joints = zip(device.config.joints, device.steps, strict=True)
        where = "at " + ", ".join(f"{joint.name} {count}" for joint, count in joints)
        if not device.config.joints:
            where = "no configuration yet: `gemelo device config --push` gives it one"
        elif not device.referenced:
            where = "position unknown: `gemelo home` finds it, `gemelo reference` declares it"
        log.info("device %s, boot %08x: %s", self._board.device_name, device.boot_id, where)

    def _advance(self, monotonic: float) -> None:
        """Let the board run up to then; what a stall of this process has missed is not caught up."""
        late, until_us = monotonic - self._advanced_to, self._clock.at(monotonic)
        if late > STALL:
            level = logging.WARNING if self._device.moving else logging.INFO
            log.log(level, "the operating system kept us waiting for %.0f ms: they are not caught up", late * 1e3)
            self._stand_still(self._device, max(0, until_us - LAST_SLOTS))
        self._advance_device(self._device, until_us)
        self._advanced_to = max(self._advanced_to, monotonic)

    def _beat(self, now: float) -> None:
        is_reachable = self._wires.is_reachable
        if now < self._next_beat and is_reachable == self._readiness.is_ready:
            return
        self._next_beat = now + BEAT
        if is_reachable:
            self._readiness.ready()
        else:
            self._readiness.not_ready("no connection to the broker")
        self._readiness.beat()
        self._wires.beat()
