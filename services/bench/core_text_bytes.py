"""Code and constants of the whole firmware core on the chip."""

from __future__ import annotations

from services.bench.chip import size
from services.bench.figure import Figure

UNIT = "bytes"
PROTOTYPE = 3700.0


def measure() -> Figure:
    return size("core_text_bytes", PROTOTYPE, "rv32imc at -Os, all of firmware/core, without libgcc")
