"""A new firmware on its way to a device: the header of its image, and the UPDATE frames of firmware/PROTOCOL.md.

An image begins as ESP-IDF's do: esp_image_header_t (24 bytes), esp_image_segment_header_t (8), esp_app_desc_t (256).
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple

import msgspec

from gemelo.libraries.runtime.serial_frames import build_frame
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because

UPDATE = 18  # frame type
PIECE = 4096  # [bytes] of an image in one frame: a sector of the flash
VIRTUAL_CHIP = 0xFFFE
CHIPS = {0: "ESP32", 2: "ESP32-S2", 5: "ESP32-C3", 9: "ESP32-S3", VIRTUAL_CHIP: "virtual device"}  # esp_chip_id_t
MAGIC, DESCRIPTION_MAGIC = 0xE9, 0xABCD5432

_IMAGE = struct.Struct("<B11xH10x")
_DESCRIPTION = struct.Struct("<8xI12x32s32s176x")  # behind the header of the first segment
HEADER = _IMAGE.size + _DESCRIPTION.size  # [bytes]
_STEP = struct.Struct("<IIB3x")


class NoImage(ReasonedError, ValueError):
    """The bytes are no image of a firmware; the reason says why."""


class ImageHeader(NamedTuple):
    """What an image says of itself."""

    chip_id: int
    version: str
    project: str

    @property
    def chip(self) -> str:
        """The name of the chip that it is for."""
        return CHIPS.get(self.chip_id, f"chip number {self.chip_id}")


class UpdateStep(IntEnum):
    """The steps of a transfer."""

    BEGIN = 1
    DATA = 2
    END = 3
    ABORT = 4


class UpdateAck(msgspec.Struct, frozen=True, kw_only=True):
    """The JSON of `update/ack`."""

    session: int
    next: int  # [bytes] that have arrived: the first one that is wanted
    accepted: bool
    receiving: bool = False  # the transfer goes on
    reason: str = ""


def read_header(image: bytes) -> ImageHeader:
    """What the image says of itself; raises NoImage."""
    if len(image) < HEADER:
        raise NoImage(because("firmware.image.short", size=len(image), least=HEADER))
    magic, chip_id = _IMAGE.unpack_from(image)
    if magic != MAGIC:
        raise NoImage(because("firmware.image.magic", byte=f"{magic:#04x}", magic=f"{MAGIC:#04x}"))
    word, version, project = _DESCRIPTION.unpack_from(image, _IMAGE.size)
    if word != DESCRIPTION_MAGIC:
        raise NoImage(because("firmware.image.no_application"))
    return ImageHeader(chip_id, _text(version), _text(project))


def build_header(header: ImageHeader) -> bytes:
    """The first bytes of an image that says so of itself."""
    description = _DESCRIPTION.pack(DESCRIPTION_MAGIC, header.version.encode(), header.project.encode())
    return _IMAGE.pack(MAGIC, header.chip_id) + description


def update_frame(step: UpdateStep, session: int, boot_id: int, offset: int = 0, content: bytes = b"") -> bytes:
    """One step of a transfer; `offset` [bytes] is the place of DATA in the image."""
    return build_frame(UPDATE, _STEP.pack(session, offset, step) + content, boot_id)


def begin_content(size: int, digest: bytes, signature: bytes) -> bytes:
    """What BEGIN says of an image: its size [bytes], SHA-256 and signature."""
    return struct.pack("<I", size) + digest + signature


def leave_for_older(digest: bytes, boot_id: int) -> bytes:
    """What the key's owner signs, instead of the image with this SHA-256, so that this boot takes it though it is
    older than what runs: nobody else can, and at no other time."""
    return digest + b"older" + boot_id.to_bytes(4, "little")


def _text(field: bytes) -> str:
    return field.split(b"\0", 1)[0].decode("ascii", "replace")
