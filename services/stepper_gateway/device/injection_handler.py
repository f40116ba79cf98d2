"""Injections into a virtual device, one at a time, each answered by the device itself."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import InjectKind, InjectRequest, InjectResponse
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected, invalid
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.reports import EventReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Answer

DONE, REFUSED = "injected", "inject_refused"


class PendingInjection(NamedTuple):
    """One that waits for its answer."""

    request: InjectRequest
    ticket: int
    deadline: float  # [s] monotonic


class InjectionHandler:
    """The device's event does not say which injection it answers, so the next one is sent after it."""

    def __init__(self, device: GatewayDevice) -> None:
        self._device = device
        self._waiting: deque[PendingInjection] = deque()

    def ask(self, request: InjectRequest, ticket: int, moment: Moment) -> None:
        """Have it done, or answer at once why not."""
        try:
            if reason := self._device.unreachable_reason(moment):
                raise invalid(reason)
            status = self._device.session.status
            if status is None or not status.virtual:
                raise invalid(
                    f'device "{self._device.arm.device.name}" is a real one: press its buttons by hand; only a virtual '
                    "device's are pressed by a request"
                )
            translated = replace(request, target=target_of(request, self._device.arm))
        except GoalRejected as rejected:
            return self._answer(ticket, False, str(rejected))
        self._waiting.append(
            PendingInjection(translated, ticket, moment.monotonic + self._device.parameters.command_timeout)
        )
        if len(self._waiting) == 1:
            self._send()

    def on_event(self, event: EventReport) -> None:
        """The device has done the oldest one, or refused it."""
        if event.event in (DONE, REFUSED):
            done = event.event == DONE
            self._conclude(done, "" if done else event.detail)

    def on_reboot(self) -> None:
        """The device has started anew."""
        self._conclude_if_asked(InjectKind.REBOOT)

    def on_last_will(self) -> None:
        """The device's broker says that it has vanished."""
        self._conclude_if_asked(InjectKind.OFFLINE)

    def step(self, moment: Moment) -> None:
        """Give up what was not answered in time."""
        while self._waiting and moment.monotonic >= self._waiting[0].deadline:
            self._conclude(False, f"the device has not answered {self._waiting[0].request.kind} in time")

    def _conclude_if_asked(self, kind: InjectKind) -> None:
        """What cuts the device's link may take its answer along: where it was asked for, it is done."""
        if self._waiting and self._waiting[0].request.kind is kind:
            self._conclude(True, "")

    def _conclude(self, accepted: bool, reason: str) -> None:
        """Answers the oldest one, if there is one, and sends the next."""
        if self._waiting:
            self._answer(self._waiting.popleft().ticket, accepted, reason)
            self._send()

    def _send(self) -> None:
        if self._waiting:
            self._device.out.send(Kind.INJECT, msgspec.json.encode(self._waiting[0].request))

    def _answer(self, ticket: int, accepted: bool, reason: str) -> None:
        self._device.out.put(Answer(ticket, InjectResponse(accepted=accepted, reason=reason)))


def target_of(request: InjectRequest, arm: ArmDescription) -> str:
    """The target as the device knows it, which calls joints by their wire names; raises `GoalRejected`."""
    match request.kind:
        case InjectKind.BLOCK | InjectKind.SLIP:
            wire_names = {joint.name: joint.wire_name for joint in arm.joints}
            wire_names |= {joint.wire_name: joint.wire_name for joint in arm.joints}
            return wire_names[_known(request.target, tuple(wire_names), "joint")]
        case InjectKind.SWITCH:
            return _known(request.target, tuple(switch.name for switch in arm.inputs), "input")
        case InjectKind.SENSOR:
            return _known(request.target, tuple(sensor.name for sensor in arm.sensors), "sensor")
        case _:
            return request.target


def _known(target: str, names: tuple[str, ...], kind: str) -> str:
    if target not in names:
        raise invalid(f'there is no {kind} "{target}"{suggestion(target, names)}')
    return target
