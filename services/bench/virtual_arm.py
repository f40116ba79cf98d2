"""The real gateway core and the real firmware core in one virtual time, joined by a wire with a delay."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable, Sequence
from itertools import count

from firmware.bindings.device import Device
from schemas.message import Message
from schemas.robot import Motor
from services.arm.description import Arm
from services.arm.device_config import device_config
from services.stepper_gateway.core import GatewayCore
from services.stepper_gateway.links.link import Kind, Received
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.outputs import Output, Publish, SendFrame

PERIOD = 20_000  # [us] of the gateway's loop
DELAY = (1_000, 8_000)  # [us] one way, uniform; in order, as over TCP
EPOCH = 1_700_000_000_000_000_000  # [ns] UNIX at virtual time 0


class VirtualArm:
    """Moves time on; hands every message of the gateway to `on_message`.

    The gateway's loop beats `phase` [us] after the device's reports. Without `motors`, none ever loses a step.
    """

    def __init__(
        self,
        arm: Arm,
        on_message: Callable[[Message], None],
        seed: int = 3,
        phase: int = 0,
        motors: Sequence[Motor] = (),
    ) -> None:
        self.device = Device(device_config(arm), boot_id=1, motors=motors)
        self.gateway = GatewayCore(arm, session_id=1)
        self.now = 0  # [us]
        self.last_beat = 0  # [us] when the device heard a heartbeat
        self.outcomes: list[Output] = []
        self._on_message = on_message
        self._random = random.Random(seed)
        self._wire: list[tuple[int, int, Kind, bytes]] = []  # arrival [us], order, kind, payload; to the device
        self._back: list[tuple[int, int, Kind, bytes]] = []
        self._last = {"there": 0, "back": 0}
        self._order = count()
        self._advance(phase)
        self.device.report_status()
        self.carry_out(self.gateway.on_link(True, "", self.moment))

    @property
    def moment(self) -> Moment:
        return Moment(EPOCH + self.now * 1000, self.now * 1e-6)

    def run(self, seconds: float) -> None:
        """Lets `seconds` of virtual time pass."""
        end = self.now + round(seconds * 1e6)
        while self.now < end:
            beat = self.now + PERIOD
            while (due := self._next_arrival()) < beat:
                self._advance(due)
                self._deliver()
            self._advance(beat)
            self.carry_out(self.gateway.step(self.moment))

    def idle(self, seconds: float) -> None:
        """Lets time pass in which the gateway's loop hangs: no heartbeat leaves."""
        end = self.now + round(seconds * 1e6)
        while (due := self._next_arrival()) < end:
            self._advance(due)
            self._deliver()
        self._advance(end)

    def carry_out(self, outputs: list[Output]) -> None:
        """Puts frames on the wire, and hands messages over."""
        for output in outputs:
            match output:
                case SendFrame(kind, payload):
                    heapq.heappush(self._wire, (self._arrival("there"), next(self._order), kind, payload))
                case Publish(_, message):
                    self._on_message(message)
                case _:
                    self.outcomes.append(output)

    def _next_arrival(self) -> int:
        return min(line[0][0] if line else 1 << 62 for line in (self._wire, self._back))

    def _arrival(self, way: str) -> int:
        self._last[way] = max(self._last[way], self.now + self._random.randint(*DELAY))
        return self._last[way]

    def _advance(self, until: int) -> None:
        self.device.advance(until)
        self.now = until
        for frame in self.device.take():
            heapq.heappush(self._back, (self._arrival("back"), next(self._order), Kind(frame.kind), frame.payload))

    def _deliver(self) -> None:
        while self._wire and self._wire[0][0] <= self.now:
            _, _, kind, payload = heapq.heappop(self._wire)
            self.last_beat = self.now if kind is Kind.HB else self.last_beat
            self.device.receive(payload)
        while self._back and self._back[0][0] <= self.now:
            _, _, kind, payload = heapq.heappop(self._back)
            received = Received(kind, payload, False, self.now * 1000)
            self.carry_out(self.gateway.on_received(received, self.moment))
