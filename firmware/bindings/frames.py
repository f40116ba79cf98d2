"""The records between a device and its platform: frames, requests, pin changes, levels."""

from __future__ import annotations

from typing import NamedTuple

from gemelo.libraries.runtime.serial_frames import JsonFrame

OUTPUTS = ("traj/ack", "cmd/ack", "sync/r", "state", "event", "status", "config/ack", "sensors", "text", "update/ack")


class OutFrame(NamedTuple):
    """Something the device said: the topic's last part and the bytes."""

    kind: str
    payload: bytes


class PlatformRequest(NamedTuple):
    """PROVISION or INJECT, as it came over the serial line."""

    kind: JsonFrame
    text: bytes


class PinChange(NamedTuple):
    """InputLevels from this tick on; bit j is joint j."""

    tick: int
    step: int
    dir: int


class LastingState(NamedTuple):
    """What a restart must find; one value for each joint."""

    config_crc32: int  # 0 for none
    steps: tuple[int, ...]  # executed
    shaft: tuple[int, ...]  # [steps] where the joints truly are
    still: bool
    referenced: bool


class InputLevels(NamedTuple):
    """The levels of the device's input pins: bit i is GPIO i, then GPIO 32 + i."""

    low: int
    high: int
