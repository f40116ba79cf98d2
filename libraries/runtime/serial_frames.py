"""Frames on a serial line, as firmware/PROTOCOL.md has them: COBS between two 0x00, and JSON in a frame.

Consistent overhead byte stuffing: Cheshire and Baker, IEEE/ACM Transactions on Networking 7(2), 1999. Pure.
"""

from __future__ import annotations

import struct
import zlib
from enum import IntEnum
from typing import NamedTuple

LARGEST = 8232  # [bytes] of a frame
LARGEST_PACKET = LARGEST + LARGEST // 254 + 1  # [bytes] of it as COBS
END = b"\x00"
MAGIC, VERSION = 0x67, 1
SYNC = 6

_HEADER = struct.Struct("<BBBBI")
_CRC = struct.Struct("<I")
_SYNC = struct.Struct("<Q")
_COMMAND = struct.Struct("<IQBBH")
COMMAND, DISARM = 3, 7
NEVER = 2**64 - 1  # of a command that does not expire


class JsonFrame(IntEnum):
    """The frame types that carry JSON; on MQTT they have topics of their own."""

    CONFIG = 9
    CONFIG_ACK = 10
    SENSORS = 11
    STATUS = 12
    EVENT = 13
    PROVISION = 14
    PROVISION_ACK = 15
    INJECT = 16
    SHAFT = 17
    UPDATE_ACK = 19


class JsonText(NamedTuple):
    """The content of a JSON frame."""

    kind: JsonFrame
    boot_id: int
    text: bytes


class BadPacket(ValueError):
    """Bytes that are no COBS packet."""


def packet(frame: bytes) -> bytes:
    """`frame` as it goes out: what was garbage on the line before it ends at the first 0x00."""
    return END + cobs_encode(frame) + END


def cobs_encode(data: bytes) -> bytes:
    """`data` without any 0x00, longer by one byte and one for every 254."""
    out = bytearray()
    blocks = data.split(END)
    for index, block in enumerate(blocks):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
            # A full block stands for no 0x00, so one that ends the data needs nothing after it.
            if not block and index == len(blocks) - 1:
                return bytes(out)
        out.append(len(block) + 1)
        out += block
    return bytes(out)


def cobs_decode(data: bytes) -> bytes:
    """The bytes that were encoded; raises `BadPacket`."""
    out = bytearray()
    at = 0
    while at < len(data):
        code = data[at]
        block = data[at + 1 : at + code]
        if code == 0 or 0 in block or len(block) != code - 1:
            raise BadPacket(f"no COBS packet: its block at byte {at} says {code}, and there are {len(data) - at} left")
        out += block
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


class PacketDecoder:
    """Splits received bytes into frames; invalid bytes are skipped and counted."""

    def __init__(self) -> None:
        self.bad = 0  # packets that were none, or too long
        self._part = bytearray()
        self._is_too_long = False

    def feed(self, data: bytes) -> list[bytes]:
        """The frames that `data` completes."""
        *ends, rest = data.split(END)
        frames = [frame for part in ends if (frame := self._complete(part))]
        self._append(rest)
        return frames

    def _append(self, part: bytes) -> None:
        self._is_too_long = self._is_too_long or len(self._part) + len(part) > LARGEST_PACKET
        if self._is_too_long:
            self._part.clear()
        else:
            self._part += part

    def _complete(self, part: bytes) -> bytes:
        """The frame that ends here; empty where there is none."""
        self._append(part)
        whole, too_long = bytes(self._part), self._is_too_long
        self._part.clear()
        self._is_too_long = False
        try:
            frame = cobs_decode(whole)
        except BadPacket:
            frame, too_long = b"", True
        self.bad += too_long
        return frame


def json_frame(kind: JsonFrame, text: bytes, boot_id: int = 0) -> bytes:
    """The frame that carries `text`."""
    return build_frame(kind, text, boot_id)


def sync_frame(t0: int) -> bytes:
    """A SYNC frame: every device answers it and does nothing else, so it tests the connection."""
    return build_frame(SYNC, _SYNC.pack(t0))


def build_frame(kind: int, body: bytes, boot_id: int = 0, joints: int = 0) -> bytes:
    """A frame of any kind: header, body and CRC."""
    frame = _HEADER.pack(MAGIC, VERSION, kind, joints, boot_id) + body
    return frame + _CRC.pack(zlib.crc32(frame))


def disarm_frame(number: int) -> bytes:
    """DISARM for whatever boot is there; one of another `number` is another command."""
    return build_frame(COMMAND, _COMMAND.pack(number, NEVER, DISARM, 0, 0))


def parse_json_frame(frame: bytes) -> JsonText | None:
    """The content of a JSON frame; None for any other frame and for a damaged one."""
    if len(frame) < _HEADER.size + _CRC.size:
        return None
    magic, version, kind, _, boot_id = _HEADER.unpack_from(frame)
    (crc,) = _CRC.unpack_from(frame, len(frame) - _CRC.size)
    if (magic, version) != (MAGIC, VERSION) or kind not in list(JsonFrame) or crc != zlib.crc32(frame[: -_CRC.size]):
        return None
    return JsonText(JsonFrame(kind), boot_id, frame[_HEADER.size : -_CRC.size])
