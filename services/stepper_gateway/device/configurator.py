"""The device's configuration: what robot.toml asks for, whether the device works with it, and giving it."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import ConfigureResponse, DeviceConfiguration, DeviceMode
from gemelo.schemas.device_config import config_crc, config_text
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import DEVICE_CONFIGURATION
from gemelo.services.stepper_gateway.device.session import DeviceSession
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.reports import ConfigAckReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Answer, Outbox

AGAIN = 1.0  # [s] until a configuration that was not answered is sent once more; chosen: a slow network answers by then
REFUSED_AGAIN = 10.0  # [s] the same for one that it has refused; chosen: somebody else may have said so
PATIENCE = 5.0  # [s] for an answer; chosen: a board writes it to its flash first
DISARMED = (DeviceMode.UNREFERENCED, DeviceMode.FAULT, DeviceMode.ESTOP)


class Configuration:
    """Whatever happens, nothing moves while the device works with another configuration than robot.toml's.

    Only the present boot's own status counts. The text is sent retained, so that a broker keeps the newest; a retained
    one of somebody else that a device meets shows in an answer to a text that is not ours, and is then replaced.
    """

    def __init__(self, arm: ArmDescription, session: DeviceSession, out: Outbox) -> None:
        self._name = arm.device.name
        self._session, self._out = session, out
        self._text = config_text(device_config(arm))
        self.crc32 = config_crc(self._text)
        self._sent = -1.0e9  # [s] monotonic
        self._refusal: Reason | None = None  # the device's, of this text
        self._refused_by = 0  # boot
        self._is_displaced = False  # the device has met another text
        self._tickets: dict[int, float] = {}  # people who wait, and until when [s] monotonic
        self._told: DeviceConfiguration | None = None

    @property
    def device_crc32(self) -> int:
        """Of what the present boot works with; 0: none, or not known."""
        status = self._session.status
        return status.config_crc32 if status is not None else 0

    @property
    def is_in_force(self) -> bool:
        return self.device_crc32 == self.crc32

    def mismatch_reason(self) -> Reason | None:
        """Why the device may not move by the configuration that it has, with the remedy; None if it may."""
        if self.is_in_force:
            return None
        name, wanted = self._name, f"{self.crc32:08x}"
        if refusal := self._refusal_of_this_boot():
            return because("device.configuration.refused", refusal, device=name)
        if self._may_take():
            return because("device.configuration.coming", device=name, wanted=wanted)
        present = f"{self.device_crc32:08x}"
        return because("device.configuration.other", device=name, present=present, wanted=wanted)

    def ask(self, ticket: int, unreachable_reason: Reason | None, moment: Moment) -> None:
        """A person wants the device to have it."""
        if unreachable_reason:
            return self._answer(ticket, unreachable_reason)
        if not self.is_in_force and not self._may_take():
            return self._answer(ticket, self.mismatch_reason())
        is_under_way = bool(self._tickets) and moment.monotonic - self._sent < AGAIN
        self._tickets[ticket] = moment.monotonic + PATIENCE
        if not is_under_way:  # else its answer is for this caller too
            self._refusal = None
            self._send(moment)

    def on_ack(self, ack: ConfigAckReport) -> None:
        """The device has answered a configuration, perhaps not one of ours."""
        if ack.crc32 != self.crc32:
            self._is_displaced = True
            what = f"the device was given another configuration ({ack.crc32:08x})"
            whose = "a retained one of the broker, or another gateway's; ours is sent again"
            return self._out.log(LogLevel.WARNING, f"{what}: {whose}")
        about = plain(f"{ack.part}: {ack.reason}" if ack.part else ack.reason)  # in the firmware's own words
        self._refusal = None if ack.accepted or self._is_about_mode() else about
        self._refused_by = self._session.boot_id
        for ticket in list(self._tickets):
            if not ack.accepted or self.is_in_force:
                self._answer(ticket, None if ack.accepted else about)

    def on_status(self) -> None:
        """The device may have said that it works with it."""
        for ticket in list(self._tickets):
            if self.is_in_force:
                self._answer(ticket, None)

    def step(self, unreachable_reason: Reason | None, moment: Moment) -> None:
        """Give it where it is missing and may be given; tell of it where something has changed."""
        for ticket, deadline in list(self._tickets.items()):
            if moment.monotonic >= deadline:
                self._answer(ticket, unreachable_reason or because("device.configuration.unanswered"))
        again = REFUSED_AGAIN if self._refusal_of_this_boot() else AGAIN
        if self._is_wanted(unreachable_reason) and moment.monotonic - self._sent >= again:
            self._send(moment)
        self._tell(unreachable_reason, moment)

    def _is_wanted(self, unreachable_reason: Reason | None) -> bool:
        if not self._session.link_up:
            return False
        if self._is_displaced or self._tickets:
            return True
        return not self.is_in_force and self._may_take() and not unreachable_reason

    def _may_take(self) -> bool:
        if self._session.mode == DeviceMode.BOOT:
            return True
        return not self._session.is_armed and self._session.mode in DISARMED

    def _is_about_mode(self) -> bool:
        """A refusal of an armed device says nothing about the text."""
        return not self._may_take()

    def _refusal_of_this_boot(self) -> Reason | None:
        return self._refusal if self._refused_by == self._session.boot_id else None

    def _send(self, moment: Moment) -> None:
        self._sent, self._is_displaced = moment.monotonic, False
        self._out.send(Kind.CONFIG, self._text)

    def _answer(self, ticket: int, reason: Reason | None) -> None:
        """Accepted where there is no reason why not."""
        self._tickets.pop(ticket, None)
        response = ConfigureResponse(
            accepted=reason is None, reason=str(reason or ""), crc32=self.device_crc32, why=reason
        )
        self._out.put(Answer(ticket, response))

    def _tell(self, unreachable_reason: Reason | None, moment: Moment) -> None:
        why = unreachable_reason or self.mismatch_reason()
        message = DeviceConfiguration(
            text=self._text.decode(),
            crc32=self.crc32,
            device_crc32=self.device_crc32,
            accepted=self.is_in_force and not unreachable_reason,
            why=why,
        )
        if message != self._told:
            self._told = message
            said = replace(message, stamp=moment.unix, reason=str(why or ""))
            self._out.publish(DEVICE_CONFIGURATION, said)
