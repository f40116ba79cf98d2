"""The device as all parts of the gateway use it: its session, configuration and commands, and why it cannot be used."""

from __future__ import annotations

from typing import Any, NamedTuple

from msgspec.structs import replace

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceEvent, DeviceStatus
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import DEVICE_EVENTS, Topic
from gemelo.services.stepper_gateway.device.configurator import Configuration
from gemelo.services.stepper_gateway.device.pending_commands import PendingCommands
from gemelo.services.stepper_gateway.device.readiness import not_ready_reason, outdated_reason
from gemelo.services.stepper_gateway.device.reporting import Reporter
from gemelo.services.stepper_gateway.device.rest_thinner import RestingTopics
from gemelo.services.stepper_gateway.device.session import DeviceSession
from gemelo.services.stepper_gateway.links.frames import REPLACE_SINCE, StateFrame
from gemelo.services.stepper_gateway.links.reports import StatusReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Outbox
from gemelo.services.stepper_gateway.parameters import GatewayParameters

QUEUE = 128  # [knots] of a device that does not say; standard: firmware/PROTOCOL.md
SETTLING = 2.5  # messages; chosen: the one under way, the last one, and the word after it


class GatewayDevice:
    """One device; nothing here moves it."""

    def __init__(self, arm: ArmDescription, session_id: int, parameters: GatewayParameters, out: Outbox) -> None:
        """`session_id` is the gateway's own, and the first number of its commands."""
        self.arm = arm
        self.joints = arm.joints
        self.parameters = parameters
        self.out = out
        self.gateway_id = session_id  # of this gateway among those before and after it
        self.session = DeviceSession(arm.device.name, len(arm.joints), session_id)
        self.configuration = Configuration(arm, self.session, out)
        self.commands = PendingCommands(session_id)
        self.reporter = Reporter(arm)
        self.resting = RestingTopics()

    @property
    def state(self) -> StateFrame | None:
        """The latest state of the arm's joints; None before the first."""
        return self.session.state

    @property
    def queue_capacity(self) -> int:
        """[knots] that the device can hold."""
        status = self.session.status
        return status.queue_capacity if status is not None and status.queue_capacity else QUEUE

    @property
    def replaces_paths(self) -> bool:
        """True if a chunk may replace what the device has not played yet."""
        status = self.session.status
        return status is not None and status.protocol[1] >= REPLACE_SINCE and not status.open_loop

    @property
    def settling_time(self) -> float:
        """[s] that a board may need after the path's end, where it is sent its steps in messages of that length."""
        return SETTLING * self.arm.device.message_time if self.session.is_open_loop else 0.0

    def publish(self, topic: Topic[Any], message: Message, moment: Moment) -> None:
        """Publishes what has changed, and now and then what has not."""
        if self.resting.passes(topic, message, self.parameters.readings_rest_rate, moment):
            self.out.publish(topic, message)

    def unreachable_reason(self, moment: Moment) -> Reason | None:
        """Why the device cannot be reached, None if it can."""
        return self.session.unreachable_reason(moment, self.parameters.state_timeout)

    def not_ready_reason(self) -> Reason | None:
        """Why the device, though it can be reached, cannot start a motion; None if it can."""
        return self._unfit_reason() or not_ready_reason(self.arm, self.state)

    def refusal(self, moment: Moment, is_coming_to_rest: bool = False) -> Reason | None:
        """Why no motion may be started now, or `is_coming_to_rest`: as soon as the device rests; None if one may."""
        not_ready = self._unfit_reason() if is_coming_to_rest else self.not_ready_reason()
        return self.unreachable_reason(moment) or not_ready or self.commands.not_ready_reason()

    def _unfit_reason(self) -> Reason | None:
        """Why this firmware, or its configuration, cannot be driven at all; None if it can."""
        status = self.session.status
        outdated = outdated_reason(self.arm.device.name, status.firmware) if status is not None else None
        return outdated or self.configuration.mismatch_reason()

    def event(
        self,
        event: str,
        about: Reason | str,
        moment: Moment,
        level: LogLevel = LogLevel.WARNING,
        log_text: str = "",
        client: str = "",
    ) -> None:
        """Report something once, on the bus and in the log; there as `log_text`, where that is given.

        `about` is why, or what the device itself says. `client` is the node that it is about, if not about everybody.
        """
        name, detail = self.arm.device.name, str(about)
        why = about if isinstance(about, Reason) else None
        report = DeviceEvent(stamp=moment.unix, device=name, event=event, detail=detail, client=client, why=why)
        self.out.publish(DEVICE_EVENTS, report)
        self.out.log(level, log_text or (f"{event}: {detail}" if detail else event))


class StatusWatch:
    """Notices where the device's status has changed: what it is made of is compared before the message is made."""

    def __init__(self, device: GatewayDevice) -> None:
        self._device = device
        self._facts: StatusFacts | None = None  # of the last one
        self._reported: DeviceStatus | None = None

    def changed(self, moment: Moment, warning: Reason | None) -> DeviceStatus | None:
        """The status, stamped, if it is another than the last one; `warning` is what else a person has to mend."""
        facts = StatusFacts.of(self._device, moment, warning)
        if facts == self._facts:
            return None
        self._facts, status = facts, facts.status(self._device)
        if status == self._reported:
            return None
        self._reported = status
        return replace(status, stamp=moment.unix)


class StatusFacts(NamedTuple):
    """All of a status that changes; only the boot that says its states is described."""

    unreachable_reason: Reason | None
    not_ready_reason: Reason | None
    report: StatusReport | None
    boot_id: int
    speaks: bool
    deaf_since: int  # [ns] UNIX time, 0: it hears
    warning: Reason | None

    @classmethod
    def of(cls, device: GatewayDevice, moment: Moment, warning: Reason | None) -> StatusFacts:
        """A silent device is offline, whatever a broker has retained."""
        session, timeout = device.session, device.parameters.state_timeout
        if not (unreachable := device.unreachable_reason(moment)):
            return cls(None, device.not_ready_reason(), session.status, session.boot_id, True, 0, warning)
        speaks, deaf_since = session.is_fresh(moment, timeout), session.deaf_since(moment, timeout)
        return cls(unreachable, None, session.status, session.boot_id, speaks, deaf_since, warning)

    def status(self, device: GatewayDevice) -> DeviceStatus:
        """The message, without a stamp."""
        report = self.report or StatusReport(online=False)
        why = self.unreachable_reason or self.not_ready_reason
        return DeviceStatus(
            online=not self.unreachable_reason,
            reason=str(why or ""),
            device=device.arm.device.name,
            firmware=report.firmware,
            boot_id=self.boot_id,
            reset_cause=report.reset_cause,
            joints=report.joints,
            tick_hz=report.tick_hz,
            queue_capacity=report.queue_capacity,
            config_crc32=report.config_crc32,
            wanted_crc32=device.configuration.crc32,
            virtual=report.virtual,
            open_loop=report.open_loop,
            speaks=self.speaks,
            deaf_since=self.deaf_since,
            warning=str(self.warning or ""),
            heap_free=report.heap_free,
            heap_least=report.heap_least,
            stack_least=report.stack_least,
            stack_task=report.stack_task,
            why=why,
            warning_why=self.warning,
        )
