"""Instructions of the 1 kHz slot on the chip, reports of the state included."""

from __future__ import annotations

from services.bench.chip import instructions
from services.bench.figure import Figure

UNIT = "instr"
PROTOTYPE = {"prototype 3 joints mean": 939.0, "prototype 6 joints mean": 1743.0}


def measure() -> Figure:
    return instructions("slot", PROTOTYPE)
