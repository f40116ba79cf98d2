"""The device as all parts of the gateway use it: its session, configuration and commands, and why it cannot be used."""

from __future__ import annotations

from schemas.device import DeviceEvent
from schemas.system import LogLevel
from schemas.topics import DEVICE_EVENTS
from services.arm.description import Arm
from services.stepper_gateway.commands import Commands
from services.stepper_gateway.configuration import Configuration
from services.stepper_gateway.hindrance import hindrance
from services.stepper_gateway.links.frames import State
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.outputs import Outbox
from services.stepper_gateway.parameters import GatewayParameters
from services.stepper_gateway.reporting import Reporter
from services.stepper_gateway.session import DeviceSession


class GatewayDevice:
    """One device; nothing here moves it."""

    def __init__(self, arm: Arm, session_id: int, parameters: GatewayParameters, out: Outbox) -> None:
        """`session_id` is the gateway's own, and the first number of its commands."""
        self.arm = arm
        self.joints = arm.joints
        self.parameters = parameters
        self.out = out
        self.session = DeviceSession(arm.device.name, len(arm.joints), session_id)
        self.configuration = Configuration(arm, self.session, out)
        self.commands = Commands(session_id)
        self.reporter = Reporter(arm)

    @property
    def state(self) -> State | None:
        """The latest state of the arm's joints; None before the first."""
        return self.session.state

    def absence(self, moment: Moment) -> str:
        """Why the device cannot be reached, empty if it can."""
        return self.session.absence(moment, self.parameters.state_timeout)

    def hindrance(self) -> str:
        """Why the device, though it can be reached, cannot start a motion; empty if it can."""
        return self.configuration.objection() or hindrance(self.arm, self.state)

    def refusal(self, moment: Moment) -> str:
        """Why no motion may be started now, empty if one may."""
        return self.absence(moment) or self.hindrance() or self.commands.hindrance()

    def event(
        self, event: str, detail: str, moment: Moment, level: LogLevel = LogLevel.WARNING, log_text: str = ""
    ) -> None:
        """Tell of something once, on the bus and in the log; there as `log_text`, where that is given."""
        self.out.publish(
            DEVICE_EVENTS, DeviceEvent(stamp=moment.unix, device=self.arm.device.name, event=event, detail=detail)
        )
        self.out.log(level, log_text or (f"{event}: {detail}" if detail else event))
