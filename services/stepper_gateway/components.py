"""The gateway's parts, and what happens to all of them at once."""

from __future__ import annotations

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason
from gemelo.services.stepper_gateway.control.control_handler import ControlHandler
from gemelo.services.stepper_gateway.device.command_handler import CommandHandler
from gemelo.services.stepper_gateway.device.echoes import Echoes
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.device.injection_handler import InjectionHandler
from gemelo.services.stepper_gateway.device.sensors import SensorRelay
from gemelo.services.stepper_gateway.goals.goal_executor import GoalExecutor
from gemelo.services.stepper_gateway.gripper.gripper_executor import GripperExecutor
from gemelo.services.stepper_gateway.ledger.confidence import LedgerRecord
from gemelo.services.stepper_gateway.ledger.step_ledger import LedgerKeeper
from gemelo.services.stepper_gateway.ledger.stopping_watch import StoppingWatch
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.target_follower import TargetFollower
from gemelo.services.stepper_gateway.outputs import Outbox
from gemelo.services.stepper_gateway.parameters import GatewayParameters


class Components:
    """Everything that moves the arm, or speaks for it, with one device."""

    def __init__(
        self, arm: ArmDescription, session_id: int, parameters: GatewayParameters, kept: LedgerRecord | None = None
    ) -> None:
        self.out = Outbox()
        self.device = GatewayDevice(arm, session_id, parameters, self.out)
        self.controller = MotionController(self.device, session_id)
        self.goals = GoalExecutor(self.device, self.controller)
        self.streaming = TargetFollower(self.device, self.controller)
        self.ledger = LedgerKeeper(self.device, kept)
        self.stopping = StoppingWatch(self.device, self.controller)
        self.command_handler = CommandHandler(self.device, self.controller, self.ledger.on_reference)
        self.gripper = GripperExecutor(self.device, self.command_handler)
        self.sensors = SensorRelay(self.device)
        self.injections = InjectionHandler(self.device)
        self.echoes = Echoes(self.device)
        self.control = ControlHandler(self, arm.name, session_id)

    def is_idle(self, moment: Moment) -> bool:
        """True while nothing is under way, and the device can be reached."""
        is_wanted = self.goals.is_active or self.streaming.is_active or self.gripper.is_active
        is_answered = self.device.commands.is_empty and self.device.unreachable_reason(moment) is None
        return is_answered and not is_wanted and not self.controller.is_followable

    def abort_all(self, reason: Reason, moment: Moment) -> None:
        """Nothing of what was under way is continued."""
        if self.goals.is_active:
            self.goals.abort(reason, moment)
        self.streaming.interrupt()
        self.controller.transmission.abandon()

    def on_unreachable(self, reason: Reason, moment: Moment) -> None:
        """The device cannot be reached: whatever it does now it does by itself."""
        is_moving = self.controller.is_followable
        self.abort_all(reason, moment)
        self.gripper.abort(reason, moment)
        self.command_handler.drop_all(reason)
        self.controller.lost()
        if is_moving:
            self.controller.leave_stop(moment)
            self.command_handler.send_due(moment)

    def stop_foreign_motion(self, moment: Moment) -> None:
        """A motion that nobody follows is stopped at once, also where a device comes back with it."""
        if self.controller.stop_foreign_motion(moment):
            self.goals.on_foreign_motion(moment)
            self.command_handler.send_due(moment)

    def start_over(self, reason: Reason, moment: Moment) -> None:
        """Another boot, or another configuration: what the gateway knew of the arm's steps means nothing."""
        self.abort_all(reason, moment)
        self.gripper.abort(reason, moment)
        self.command_handler.drop_all(reason)
        self.controller.start_over()
