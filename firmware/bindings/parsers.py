"""The firmware's own parsers: configuration and provisioning, from JSON."""

from __future__ import annotations

import ctypes as c

import msgspec

from gemelo.firmware.bindings.library import PART_SIZE, REASON_SIZE, load_library
from gemelo.schemas.device_config import DeviceConfig

LARGEST = 1 << 16  # [bytes] of what the core says it has read


class ConfigTextRefused(ValueError):
    """The core does not take the text; the message is the part and the reason."""

    def __init__(self, part: str, reason: str) -> None:
        super().__init__(f"{part}: {reason}" if part else reason)
        self.part = part
        self.reason = reason


def read_config(text: bytes) -> DeviceConfig:
    """The configuration as the core has understood it; raises ConfigTextRefused."""
    part, reason = c.create_string_buffer(PART_SIZE), c.create_string_buffer(REASON_SIZE)
    out = c.create_string_buffer(LARGEST)
    size = load_library().gemelo_read_config(text, len(text), part, reason, out, LARGEST)
    if size < 0:
        raise ConfigTextRefused(part.value.decode(), reason.value.decode(errors="replace"))
    return msgspec.json.decode(out.raw[:size], type=DeviceConfig)


class ProvisionRefused(ValueError):
    """The text cannot be taken; the message holds nothing of what was said."""


def asks_for_factory_reset(text: bytes) -> bool:
    """True if the text asks for a factory reset, False if it holds credentials; raises ProvisionRefused."""
    is_reset, reason = c.c_int(), c.create_string_buffer(REASON_SIZE)
    if not load_library().gemelo_check_provision(text, len(text), c.byref(is_reset), reason):
        raise ProvisionRefused(reason.value.decode())
    return bool(is_reset.value)
