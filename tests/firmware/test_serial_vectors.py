"""The vectors of the serial line that the firmware's own tests are held against too."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.parsers import ConfigTextRefused, read_config
from gemelo.libraries.runtime.serial_frames import PacketDecoder
from gemelo.schemas.device_config import DeviceConfig

FOLDER = Path(__file__).resolve().parents[2] / "firmware/tests/vectors/serial"
LINES = json.loads((FOLDER / "lines.json").read_text())


def cases(content: list[dict[str, Any]]) -> list[Any]:
    return [pytest.param(case, id=case["name"]) for case in content]


@pytest.mark.parametrize("case", cases(json.loads((FOLDER / "packets.json").read_text())))
def test_packets_are_cut_alike(case: dict[str, Any]):
    packets = PacketDecoder()
    frames = packets.feed(bytes.fromhex(case["sent"]))
    # Python hands on what is well packed but does not begin with the magic; the core drops it at once.
    assert [frame.hex() for frame in frames if frame.startswith(b"g")] == case["frames"]


@pytest.mark.parametrize("case", cases(LINES["cases"]))
def test_lines_are_answered_alike(case: dict[str, Any]):
    device = CoreDevice(msgspec.convert(LINES["config"], DeviceConfig))
    device.attach_line()
    device.take_serial()
    for line in case["lines"]:
        device.receive_serial(line.encode() + b"\n")
    said = device.take_serial()
    answers = [part for part in said.replace(b"\0", b"\n").split(b"\n") if part[:5] in (b"<ACK,", b"<NAK,")]
    assert [answer.decode() for answer in answers] == case["answers"]


@pytest.mark.parametrize("case", cases(json.loads((FOLDER / "configs.json").read_text())))
def test_configurations_are_judged_alike(case: dict[str, Any]):
    part = reason = ""
    try:
        read_config(case["text"].encode())
    except ConfigTextRefused as refused:
        part, reason = refused.part, refused.reason
    assert (part, reason) == (case["part"], case["reason"])
