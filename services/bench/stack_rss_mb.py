"""How much memory each process of the stack holds."""

from __future__ import annotations

from services.bench.figure import Figure, of_samples, rounded
from services.bench.stack_processes import families, rss_mb
from services.bench.stacks import Stacks

UNIT = "MB per process"


def measure(stacks: Stacks) -> Figure:
    sizes = {name: rss_mb(family) for name, family in families(stacks.any_broker().stack).items()}
    parts = ", ".join(f"{name} {rounded(size):g}" for name, size in sorted(sizes.items(), key=lambda item: -item[1]))
    note = f"resident, shared libraries counted for each; together {sum(sizes.values()):.0f} MB: {parts}"
    return of_samples(list(sizes.values()), UNIT, note=note)
