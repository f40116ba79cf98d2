"""The ledger as it is kept over restarts; the file that holds it is `ledger_file.py`'s."""

from __future__ import annotations

from msgspec import Struct

from gemelo.services.stepper_gateway.ledger.confidence import Evidence


class LedgerRecord(Struct, frozen=True, kw_only=True):
    """One arm on one device. Where the device or its configuration is another, none of it counts."""

    device: str = ""
    virtual: bool = False
    config_crc32: int = 0  # steps of another configuration mean other places
    boot_id: int = 0
    is_moving: bool = False  # what came after this was written, nobody knows
    steps: tuple[int, ...] = ()  # executed
    joints: dict[str, Evidence] = {}  # by name
