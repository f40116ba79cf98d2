"""A gateway that drives a sketch over dialect "ra", in one virtual time."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import msgspec

from gemelo.firmware.platform.host.sketch import PASS, HostSketch
from gemelo.libraries.arm.model.description import ArmDescription, as_its_board_drives_it
from gemelo.libraries.arm.motors.relative_moves import ramp_of
from gemelo.schemas.device import DeviceCommandKind
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.links.foreign import ra_messages
from gemelo.services.stepper_gateway.links.foreign.ra_device import RaDevice
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.foreign_arm import ForeignArm
from gemelo.tools.virtual_arm.gateway_driver import GatewayParameters, LinkInput
from gemelo.tools.virtual_arm.virtual_arm import GATEWAY_ZERO, rm1

STEP = 0.005  # [s] of virtual time


def ra_arm(message_time: float = 2.0) -> ArmDescription:
    """rm1 behind a sketch that takes `message_time` [s] for a message."""
    arm = rm1()
    device = msgspec.structs.replace(arm.device, dialect=Dialect.RA, message_time=message_time)
    return as_its_board_drives_it(replace(arm, device=device))


class SketchArm(ForeignArm):
    """Messages take `delay` to `delay` + `jitter` [s], in order, as over TCP."""

    def __init__(
        self,
        arm: ArmDescription | None = None,
        *,
        delay: float = 0.005,
        jitter: float = 0.0,
        truncates: bool = True,
        pass_time: float = PASS,
        seed: int = 1,
    ) -> None:
        super().__init__(STEP)
        self.arm = arm or ra_arm()
        self._delay, self._jitter, self._rng = delay, jitter, random.Random(seed)
        boots = itertools.count(1001)
        self.device = RaDevice(self.arm, lambda: next(boots), GATEWAY_ZERO)
        self.sketch = HostSketch(
            [ramp_of(joint.drive) for joint in self.arm.joints], truncates, pass_time=pass_time, seed=seed,
            telemetry_time=self.arm.device.telemetry_time,
        )  # fmt: skip
        self.messages_sent: list[bytes] = []
        self.is_cut = False  # between the sketch and the broker
        self.drops = 0  # messages that will be lost with a connection before they are at the broker
        self._down: list[tuple[float, bytes]] = []
        self._up: list[tuple[float, str, bytes]] = []
        self.start_core(self.arm, seed, GatewayParameters())
        self.handle(LinkInput(True, ""))

    def send(self, kind: Kind, payload: bytes) -> None:
        self.device.receive(kind, payload, self.moment.monotonic)

    def _exchange(self) -> None:
        monotonic = self.moment.monotonic
        while self._down and self._down[0][0] <= self.now:
            _, message = self._down.pop(0)
            self.sketch.receive(message)
            self.device.hear(ra_messages.JOINTS, message, False, monotonic)  # the broker passes it to all
        for topic, payload in self.sketch.advance(self.now):
            if not self.is_cut:
                self._up.append((self._arrival(self._up[-1][0] if self._up else 0.0), topic, payload))
        while self._up and self._up[0][0] <= self.now:
            _, topic, payload = self._up.pop(0)
            self.device.hear(topic, payload, False, monotonic)
        for message in self.device.advance(monotonic):
            self.messages_sent.append(message)
            if self.drops:
                self.drops -= 1
            elif not self.is_cut:
                self._down.append((self._arrival(self._down[-1][0] if self._down else 0.0), message))
        for kind, report in self.device.take():
            self.receive(kind, report)

    def send_as_another(self, message: bytes) -> None:
        """Another program sends it on ra/juntas."""
        self._down.append((self._arrival(self._down[-1][0] if self._down else 0.0), message))

    def _arrival(self, after: float) -> float:
        return max(after, self.now + self._delay + self._rng.random() * self._jitter)

    def referenced(self) -> SketchArm:
        """A person has said where the joints are: it accepts goals."""
        assert self.run(
            4.0, lambda: bool(self.published["device/status"]) and self.published["device/status"][-1].online
        )
        self.command(DeviceCommandKind.REFERENCE, 99)
        assert self.run(3.0, lambda: 99 in self.answers and not self.reason_not_ready), self.reason_not_ready
        return self
