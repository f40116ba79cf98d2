"""`firmware/tests/rv32/run`: size, instructions and golden traces of the core on rv32imc; see gates.toml."""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from gemelo.firmware.tests.rv32 import measure, toolchain


def main() -> int:
    parser = argparse.ArgumentParser(prog="firmware/tests/rv32/run", description=__doc__)
    parser.add_argument("--json", action="store_true", help="only the figures, as JSON; without the golden traces")
    options = parser.parse_args()
    lack = toolchain.missing()
    if lack:
        in_ci = "CI" in os.environ  # which installs them: there a gate that was not held is a failure
        print(json.dumps({"missing": lack}) if options.json else f"rv32: {'FAILED' if in_ci else 'skipped'}, {lack}")
        return int(in_ci and not options.json)
    with tempfile.TemporaryDirectory() as folder:
        try:
            return report(Path(folder)) if options.json else gate(Path(folder))
        except toolchain.Broken as error:
            print(f"rv32: {error}", file=sys.stderr)
            return 1


def report(folder: Path) -> int:
    """The figures for `make bench`, each with the bound that it is held to."""
    figures = measure.cost(*measure.build(folder), folder)
    print(json.dumps({"figures": figures, "gates": bounds()}))
    return 0


def gate(folder: Path) -> int:
    """Every figure against its bound, what the machine code may do, and the two traces against each other."""
    core, play = measure.build(folder)
    figures = measure.cost(core, play, folder)
    host, chip = measure.traces(core, play, folder)
    faults = [
        *(f"{name} is {figures[name]:g}, above {bound:g}" for name, bound in bounds().items() if figures[name] > bound),
        *measure.faults(core, table()["library_calls"], folder),
        *measure.differences(host, chip),
    ]
    print("rv32: " + ", ".join(f"{name} {figures[name]:g}" for name in bounds()))
    for fault in faults:
        print(f"rv32: FAILED: {fault}", file=sys.stderr)
    if faults:
        return 1
    print(
        f"rv32: all within gates.toml, golden traces of {len(host.splitlines())} lines identical on the host and rv32"
    )
    return 0


def bounds() -> dict[str, float]:
    """The largest value allowed, by the figure's name, which ends in its unit: [bytes] or [instructions]."""
    return {name: value for name, value in table().items() if name != "library_calls"}


def table() -> dict[str, Any]:
    return tomllib.loads((toolchain.HERE / "gates.toml").read_text())


sys.exit(main())
