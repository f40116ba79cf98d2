"""A gateway that drives a board of dialect "text", in one virtual time."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace

import msgspec

from gemelo.libraries.arm.model.description import ArmDescription, as_its_board_drives_it
from gemelo.schemas.device import DeviceCommandKind
from gemelo.schemas.reasons import Reason
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.links.foreign.text_device import TextDevice
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.foreign_arm import ForeignArm
from gemelo.tools.virtual_arm.gateway_driver import GatewayParameters, link_input
from gemelo.tools.virtual_arm.virtual_arm import GATEWAY_ZERO, rm1

STEP = 0.001  # [s] of virtual time
TRIP = 0.009  # [s] of a line and its answer; chosen: what both take at 115,200 baud, and the board between them
BAUD = 115_200

_LINE = re.compile(rb"<(\d+),([-+0-9.,]+)>\n")


def text_arm() -> ArmDescription:
    """rm1 behind a board that reads `<SEQ,J1,...>`."""
    arm = rm1()
    return as_its_board_drives_it(replace(arm, device=msgspec.structs.replace(arm.device, dialect=Dialect.TEXT)))


class TextArm(ForeignArm):
    """The board answers every line `trip` [s] later, while it answers."""

    def __init__(self, *, trip: float = TRIP, seed: int = 1) -> None:
        super().__init__(STEP)
        self.arm, self._trip = text_arm(), trip
        self.answers_lines = True
        self.lines: list[tuple[float, tuple[float, ...]]] = []  # [s] and [rad] or [m] of each
        self._answers: list[tuple[float, bytes]] = []  # that are under way, with [s] of their arrival
        boots = itertools.count(1001)
        self.device = TextDevice(self.arm, lambda: next(boots), GATEWAY_ZERO, BAUD)
        self._link: tuple[bool, Reason | None] = (True, None)
        self.start_core(self.arm, seed, GatewayParameters())
        self.handle(link_input(*self._link))

    def send(self, kind: Kind, payload: bytes) -> None:
        if not self.device.objection:
            self.device.receive(kind, payload, self.moment.monotonic)

    def _exchange(self) -> None:
        monotonic = self.moment.monotonic
        while self._answers and self._answers[0][0] <= self.now:
            self.device.hear(self._answers.pop(0)[1], monotonic)
        for line in self.device.advance(monotonic):
            self._read(line)
        link = (self.device.objection is None, self.device.objection)
        if link != self._link:
            self._link = link
            self.handle(link_input(*link))
        for kind, report in self.device.take():
            self.receive(kind, report)

    def _read(self, line: bytes) -> None:
        found = _LINE.fullmatch(line)
        assert found is not None, line
        self.lines.append((self.now, tuple(float(number) for number in found[2].split(b","))))
        if self.answers_lines:
            self._answers.append((self.now + self._trip, b"<ACK,%s,%d>\n" % (found[1], round(self.now * 1e6))))

    def referenced(self) -> TextArm:
        """A person has said where the joints are: it accepts goals."""
        assert self.run(4.0, lambda: not self.core.device.unreachable_reason(self.moment))
        self.command(DeviceCommandKind.REFERENCE, 99)
        assert self.run(3.0, lambda: 99 in self.answers and not self.reason_not_ready), self.reason_not_ready
        return self
