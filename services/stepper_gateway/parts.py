"""The gateway's parts, and what happens to all of them at once."""

from __future__ import annotations

from services.arm.description import Arm
from services.stepper_gateway.desk import CommandDesk
from services.stepper_gateway.gateway_device import GatewayDevice
from services.stepper_gateway.goals import Goals
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.mover import MotionController
from services.stepper_gateway.outputs import Outbox
from services.stepper_gateway.parameters import GatewayParameters
from services.stepper_gateway.presses import PressDesk
from services.stepper_gateway.sensors import SensorWatch
from services.stepper_gateway.streaming import Streaming


class Parts:
    """Everything that moves the arm, or speaks for it, with one device."""

    def __init__(self, arm: Arm, session_id: int, parameters: GatewayParameters) -> None:
        self.out = Outbox()
        self.device = GatewayDevice(arm, session_id, parameters, self.out)
        self.controller = MotionController(self.device, session_id)
        self.goals = Goals(self.device, self.controller)
        self.streaming = Streaming(self.device, self.controller)
        self.desk = CommandDesk(self.device, self.controller)
        self.sensors = SensorWatch(self.device)
        self.presses = PressDesk(self.device)

    def fail(self, reason: str, moment: Moment) -> None:
        """Nothing of what was under way is continued."""
        if self.goals.is_active:
            self.goals.abort(reason, moment)
        self.streaming.interrupt()
        self.controller.transmission.abandon()

    def lose(self, reason: str, moment: Moment) -> None:
        """The device cannot be reached: whatever it does now it does by itself."""
        is_moving = self.controller.is_followable
        self.fail(reason, moment)
        self.desk.give_up(reason)
        self.controller.lost()
        if is_moving:
            self.controller.leave_stop(moment)
            self.desk.send_due(moment)

    def stop_strangers(self, moment: Moment) -> None:
        """A motion that nobody follows is stopped at once, also where a device comes back with it."""
        if self.controller.stop_strangers(moment):
            self.goals.on_stranger(moment)
            self.desk.send_due(moment)

    def begin_anew(self, reason: str, moment: Moment) -> None:
        """Another boot, or another configuration: what the gateway knew of the arm's steps means nothing."""
        self.fail(reason, moment)
        self.desk.give_up(reason)
        self.controller.begin_anew()
