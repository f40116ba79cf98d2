"""`out/bench.json` and the table that a person reads."""

from __future__ import annotations

import platform
import subprocess
import textwrap
from collections.abc import Mapping
from pathlib import Path

import msgspec
import psutil

from services.bench.figure import Figure
from services.cli.text_table import table


class BenchReport(msgspec.Struct, frozen=True):
    """Exactly what `out/bench.json` holds."""

    commit: str
    machine: str
    figures: dict[str, Figure]


def report_of(figures: Mapping[str, Figure], root: Path) -> BenchReport:
    return BenchReport(commit(root), machine(), dict(figures))


def commit(root: Path) -> str:
    """The commit that was measured; `+` where the tree differs from it."""
    try:
        head = _git(root, "rev-parse", "--short=12", "HEAD")
        return head + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def machine() -> str:
    """What it was measured on, without naming the machine."""
    memory = psutil.virtual_memory().total / 2**30
    return (
        f"{processor()}, {psutil.cpu_count()} cores, {memory:.0f} GiB, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}, load average at the end {psutil.getloadavg()[0]:.1f}"
    )


def processor() -> str:
    """The processor's own name, where Linux says it."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"


def text_of(report: BenchReport) -> str:
    """The table, and under it for each figure its note and what it is held against."""
    rows = [
        (name, figure.unit, _number(figure.median), _number(figure.p99), figure.goal or "-", _verdict(figure))
        for name, figure in report.figures.items()
    ]
    told = [_told(name, figure) for name, figure in report.figures.items() if figure.note or figure.reference]
    headings = ("figure", "unit", "median", "p99", "goal", "met")
    return f"{report.machine}, commit {report.commit}\n\n{table(headings, rows)}\n\n" + "\n".join(told)


def _told(name: str, figure: Figure) -> str:
    """The note, and the references, as many in a line as there is room for."""
    held = "; ".join(f"{what} {value:g}" for what, value in figure.reference.items())
    texts = [f"{name}: {figure.note}", *([held] if held else [])]
    return "\n".join(
        textwrap.fill(text, 116, initial_indent="    " * (place > 0), subsequent_indent="    ", break_on_hyphens=False)
        for place, text in enumerate(texts)
    )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


def _verdict(figure: Figure) -> str:
    if figure.median is None:
        return "NO FIGURE"
    return "-" if figure.met is None else "yes" if figure.met else "NO"
