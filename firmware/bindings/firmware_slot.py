"""The slot that a virtual device writes a new firmware into: what its platform does, and how the core calls it."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from typing import Any, Protocol

from gemelo.firmware.bindings.library import REASON_SIZE, FirmwareCalls

DIGEST = 32  # [bytes] SHA-256


class SlotRefused(Exception):
    """It cannot be done; the message says why, in at most 127 bytes."""


class FirmwareSlot(Protocol):
    """Called while nothing moves and the drivers are off; each method raises SlotRefused."""

    def verify(self, digest: bytes, signature: bytes) -> None:
        """Returns if the signature of an image with this SHA-256 is good."""

    def begin(self, size: int) -> None:
        """Opens the slot for an image of `size` bytes; what was in it is lost."""

    def write(self, data: bytes) -> None:
        """Appends to it."""

    def finish(self, digest: bytes) -> None:
        """Returns if what was written has this SHA-256, and is started next."""

    def abort(self) -> None:
        """Closes the slot; what was written is of no use."""

    def permits_older(self, digest: bytes, boot_id: int, signature: bytes) -> bool:
        """True if it lets this boot take an image with this SHA-256 though it is older than what runs."""


def firmware_calls(slot: FirmwareSlot) -> FirmwareCalls:
    """The functions that the core calls; to be kept for as long as the device lives."""

    def guarded(action: Callable[[], None], reason: Any) -> int:
        try:
            action()
        except SlotRefused as error:
            text = str(error).encode()[: REASON_SIZE - 1]
            c.memmove(reason, text + b"\0", len(text) + 1)
            return 0
        return 1

    def verify(digest: Any, signature: Any, size: int, reason: Any) -> int:
        said = c.string_at(digest, DIGEST), c.string_at(signature, size)
        return guarded(lambda: slot.verify(*said), reason)

    def permits_older(digest: Any, boot_id: int, signature: Any, size: int) -> int:
        return int(slot.permits_older(c.string_at(digest, DIGEST), boot_id, c.string_at(signature, size)))

    def write(data: Any, size: int, reason: Any) -> int:
        return guarded(lambda: slot.write(c.string_at(data, size)), reason)

    kinds = dict(FirmwareCalls._fields_)
    return FirmwareCalls(
        kinds["verify"](verify),
        kinds["begin"](lambda size, reason: guarded(lambda: slot.begin(size), reason)),
        kinds["write"](write),
        kinds["finish"](lambda digest, reason: guarded(lambda: slot.finish(c.string_at(digest, DIGEST)), reason)),
        kinds["abort"](slot.abort),
        kinds["permits_older"](permits_older),
    )
