"""Instructions of the step interrupt on the chip."""

from __future__ import annotations

from services.bench.chip import instructions
from services.bench.figure import Figure

UNIT = "instr"
PROTOTYPE = {"prototype 3 joints mean": 59.0, "prototype 6 joints mean": 106.0}


def measure() -> Figure:
    return instructions("tick", PROTOTYPE)
