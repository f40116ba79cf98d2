"""The version of firmware/PROTOCOL.md that a device announces: replacements go to one that knows them only."""

from __future__ import annotations

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.schemas.device_config import config_text
from gemelo.services.stepper_gateway.links.foreign.stand_in import StandIn
from gemelo.services.stepper_gateway.links.frames import REPLACE_SINCE
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.reports import StatusReport, decode_report
from gemelo.tools.virtual_arm.virtual_arm import rm1

STEPS = (0, 0, 0)


def announced(reports: list[tuple[str, bytes]]) -> tuple[int, int]:
    (status,) = [payload for kind, payload in reports if kind == Kind.STATUS]
    return decode_report(StatusReport, status).protocol


def test_a_device_of_ours_announces_that_it_knows_replacements() -> None:
    device = CoreDevice(config_text(device_config(rm1())), 1, steps=STEPS, referenced=True)
    oldest, newest = announced([(frame.kind, frame.payload) for frame in device.take()])
    assert oldest == 1
    assert newest >= REPLACE_SINCE


def test_a_board_of_another_dialect_announces_none() -> None:
    board = StandIn(rm1(), "a board", STEPS, lambda: 1, 0.0)
    board.take(True)
    board.report_status()
    assert announced(list(board.take(True))) < (1, REPLACE_SINCE)


def test_a_device_that_announces_nothing_knows_none() -> None:
    assert decode_report(StatusReport, b'{"online": true, "device": "old"}').protocol == (1, 1)
