"""The JSON of `provision`, read by the core's own parser."""

from __future__ import annotations

import ctypes as c

from firmware.bindings.library import REASON_SIZE, load_library


class ProvisionRefused(ValueError):
    """The text cannot be taken; the message holds nothing of what was said."""


def asks_for_factory_reset(text: bytes) -> bool:
    """Whether it asks to forget all, or else brings credentials; raises ProvisionRefused."""
    is_reset, reason = c.c_int(), c.create_string_buffer(REASON_SIZE)
    if not load_library().gemelo_check_provision(text, len(text), c.byref(is_reset), reason):
        raise ProvisionRefused(reason.value.decode())
    return bool(is_reset.value)
