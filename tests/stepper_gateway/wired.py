"""The gateway's core on a real wire in real time."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.schemas.device import InjectRequest, InjectResponse
from gemelo.services.stepper_gateway.links.link import Link
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from gemelo.tools.virtual_arm.gateway_driver import (
    FrameInput,
    GatewayDriver,
    InjectInput,
    Kind,
    Moment,
    StepInput,
    link_input,
)
from gemelo.tools.virtual_arm.virtual_arm import rm1
from tests.stepper_gateway.harness import move


def plain(port: int) -> BrokerAccess:
    """A broker on the loopback that lets everybody in."""
    return BrokerAccess("127.0.0.1", port, is_ours=True)


class WiredGateway(GatewayDriver):
    """Core and link with a small loop of their own, without the bus."""

    def __init__(
        self, port: int = 0, link: Callable[[Callable[[], None]], Link] | None = None, arm: ArmDescription | None = None
    ) -> None:
        super().__init__()
        self.arm = arm or rm1()
        self.start_core(self.arm, int.from_bytes(os.urandom(3), "little") + 1)
        self._woken = threading.Event()
        self.link = link(self._woken.set) if link else MqttLink(plain(port), "rm1", self._woken.set)

    def close(self) -> None:
        self.link.close()

    @property
    def moment(self) -> Moment:
        return Moment(time.time_ns(), time.monotonic())

    def send(self, kind: Kind, payload: bytes) -> None:
        self.link.send(kind, payload)

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        end = time.monotonic() + seconds
        due = 0.0
        while time.monotonic() < end:
            if until is not None and until():
                return True
            if time.monotonic() >= due:
                due = time.monotonic() + 0.02
                self.handle(StepInput())
            self._woken.wait(max(0.0, due - time.monotonic()))
            self._woken.clear()
            self.handle(link_input(self.link.connected, self.link.reason))
            for received in self.link.take(64):
                self.handle(FrameInput(*received))
        return until is None or until()

    def ready(self) -> None:
        assert self.run(15.0, lambda: not self.reason_not_ready), self.reason_not_ready
        self.run(0.1)

    def move_to(self, end: tuple[float, ...], goal_id: str = "g") -> Any:
        """Asks for a jerk-limited move from where the arm is."""
        return self.goal(move(self.published["joint_states"][-1].position, end, arm=self.arm), goal_id)

    def answer_to_press(self, request: InjectRequest) -> InjectResponse:
        """The answer of the virtual device."""
        self.handle(InjectInput(1, request))
        assert self.run(8.0, lambda: 1 in self.pressed)
        return self.pressed.pop(1)
