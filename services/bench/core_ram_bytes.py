"""Memory of the firmware core on the chip."""

from __future__ import annotations

from services.bench.chip import size
from services.bench.figure import Figure

UNIT = "bytes"
PROTOTYPE = 7250.0


def measure() -> Figure:
    return size("core_ram_bytes", PROTOTYPE, "rv32imc, 6 joints, 128 knots; without the stack")
