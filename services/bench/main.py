"""`make bench`: every figure that the project promises, measured here and now, into out/bench.json and a table.

A figure that cannot be measured says why; nothing is estimated. Exit code 1 if one is missing; a goal that is not met
is said, and is not an error.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import ModuleType

import msgspec

from services.bench.figure import Figure, guarded
from services.bench.report import report_of, text_of
from services.bench.stacks import Stacks
from services.runtime.deployment import project_root

ALONE = (
    "frame_lookup_us",
    "state_check_us",
    "collision_checks_per_s",
    "ik_ms",
    "ik_success",
    "plan_ms",
    "plan_success",
    "path_length_ratio",
    "duration_ratio",
    "plan_python_ms",
    "plan_mesh_ms",
    "lin_ms",
    "jog_tick_us",
    "lost_of_45000_at_25hz",
    "seed_move_percent",
    "clock_sync_error_us",
    "hold_reaction_ms",
    "max_step_rate_hz",
    "parse_mb_per_s",
    "step_time_error_us",
    "estop_reaction_ticks",
    "cli_start_ms",
)  # before any stack disturbs them
ON_A_STACK = ("stack_idle_cpu_percent", "stack_rss_mb", "state_to_frame_ms", "move_accept_to_first_step_ms", "stop_ms")
BROKERS = {"chunk_ack_ms": "mosquitto", "chunk_ack_ms_amqtt": "amqtt"}
CHIP = ("tick_instructions", "slot_instructions", "core_text_bytes", "core_ram_bytes")
LAST = ("ready_s",)
NAMES = (*ALONE, *CHIP, *ON_A_STACK, *BROKERS, *LAST)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="make bench", description="Measure the figures that the project promises.")
    parser.add_argument("--only", nargs="+", choices=NAMES, metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--out", type=Path, default=project_root() / "out/bench.json")
    options = parser.parse_args()
    sys.exit(bench(options.only or NAMES, options.out))


def bench(names: Iterable[str], out: Path) -> int:
    """Measures, writes, prints; the exit code."""
    names = [name for name in NAMES if name in set(names)]
    figures: dict[str, Figure] = {}
    with Stacks() as stacks:
        for name in names:
            print(f"bench: {name} ...", flush=True)
            figures[name] = measured(name, stacks)
    report = report_of(figures, project_root())
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    print(f"\n{text_of(report)}\n\nwritten to {out}")
    return 1 if any(figure.median is None for figure in figures.values()) else 0


def measured(name: str, stacks: Stacks) -> Figure:
    """One figure, by the module that bears its name."""
    module = module_of(name)
    measure: Callable[..., Figure] = module.measure
    if name in BROKERS:
        return guarded(partial(measure, stacks, BROKERS[name]), module.UNIT)
    return guarded(partial(measure, *(() if name in (*ALONE, *CHIP) else (stacks,))), module.UNIT)


def module_of(name: str) -> ModuleType:
    """Imported only when asked for: pinocchio and yourdfpy are slow to import."""
    return importlib.import_module(f"services.bench.{name.removesuffix('_amqtt')}")


if __name__ == "__main__":
    main()
