"""What the firmware core costs on rv32imc, as firmware/tests/rv32/run measures it: once for all figures."""

from __future__ import annotations

import subprocess
from functools import cache

import msgspec

from services.bench.figure import Figure, NotMeasured
from services.runtime.deployment import project_root

RUN = "firmware/tests/rv32/run"


class Cost(msgspec.Struct, frozen=True):
    """What the script prints: figures and the bounds of gates.toml by the same names, or what is missing."""

    figures: dict[str, float] = {}
    gates: dict[str, float] = {}
    missing: str = ""


@cache
def cost() -> Cost:
    """Compiles and runs the core; raises NotMeasured where that cannot be."""
    done = subprocess.run([project_root() / RUN, "--json"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotMeasured(f"{RUN} failed: {done.stderr.strip()[-300:]}")
    measured = msgspec.json.decode(done.stdout, type=Cost)
    if measured.missing:
        raise NotMeasured(measured.missing)
    return measured


def instructions(what: str, prototype: dict[str, float]) -> Figure:
    """Median and p99 of `what` (tick, slot) with 6 joints in a plain move; means, and the most in any play, beside."""
    measured = cost()
    means = {f"{joints} joints mean": measured.figures[f"{what}_{joints}_mean"] for joints in (3, 6)}
    most = {f"{joints} joints most": measured.figures[f"{what}_{joints}_max"] for joints in (3, 6)}
    gates = ", ".join(f"{name} {bound:g}" for name, bound in measured.gates.items() if name.startswith(what))
    return Figure(
        unit="instr",
        median=measured.figures[f"{what}_6_median"],
        p99=measured.figures[f"{what}_6_p99"],
        reference=means | most | prototype,
        note=f"rv32imc at -Os under QEMU, 6 joints, the fastest at up to 3,750 steps/s, TICK_HZ 50,000; gates: {gates}",
    )


def size(name: str, prototype: float, note: str) -> Figure:
    """Bytes; every run gives the same."""
    measured = cost()
    value = measured.figures[name]
    return Figure(
        unit="bytes",
        median=value,
        p99=value,
        reference={"prototype": prototype},
        note=f"{note}; gate: {measured.gates[name]:g}",
    )
