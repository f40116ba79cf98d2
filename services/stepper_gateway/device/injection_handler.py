"""Injections into a virtual device, one at a time, each answered by the device itself."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import InjectKind, InjectRequest, InjectResponse
from gemelo.schemas.reasons import Reason, because, plain
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
                raise invalid(because("injection.real_device", device=self._device.arm.device.name))
            translated = replace(request, target=target_of(request, self._device.arm))
        except GoalRejected as rejected:
            return self._answer(ticket, rejected.reason)
        self._waiting.append(
            PendingInjection(translated, ticket, moment.monotonic + self._device.parameters.command_timeout)
        )
        if len(self._waiting) == 1:
            self._send()

    def on_event(self, event: EventReport) -> None:
        """The device has done the oldest one, or refused it."""
        if event.event in (DONE, REFUSED):
            self._conclude(None if event.event == DONE else plain(event.detail))  # in the device's own words

    def on_reboot(self) -> None:
        """The device has started anew."""
        self._conclude_if_asked(InjectKind.REBOOT)

    def on_last_will(self) -> None:
        """The device's broker says that it has vanished."""
        self._conclude_if_asked(InjectKind.OFFLINE)

    def step(self, moment: Moment) -> None:
        """Give up what was not answered in time."""
        while self._waiting and moment.monotonic >= self._waiting[0].deadline:
            self._conclude(because("injection.unanswered", kind=self._waiting[0].request.kind.value))

    def _conclude_if_asked(self, kind: InjectKind) -> None:
        """What cuts the device's link may take its answer along: where it was asked for, it is done."""
        if self._waiting and self._waiting[0].request.kind is kind:
            self._conclude(None)

    def _conclude(self, reason: Reason | None) -> None:
        """Answers the oldest one, if there is one, and sends the next."""
        if self._waiting:
            self._answer(self._waiting.popleft().ticket, reason)
            self._send()

    def _send(self) -> None:
        if self._waiting:
            self._device.out.send(Kind.INJECT, msgspec.json.encode(self._waiting[0].request))

    def _answer(self, ticket: int, reason: Reason | None) -> None:
        """Done where there is no reason why not."""
        response = InjectResponse(accepted=reason is None, reason=str(reason or ""), why=reason)
        self._device.out.put(Answer(ticket, response))


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
        raise invalid(because("injection.unknown", nearest(target, names), kind=kind, name=target))
    return target
