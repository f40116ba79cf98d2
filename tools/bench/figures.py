"""Measured figures, the report that `out/bench.json` holds, and the table that a person reads."""

from __future__ import annotations

import math
import platform
import subprocess
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import msgspec
import psutil

from gemelo.tools.cli.common.text_table import table


class Figure(msgspec.Struct, frozen=True, kw_only=True):
    """One figure, all values in `unit`; `median` and `p99` are None if it could not be measured: `note` says why."""

    unit: str = ""  # from the table of figures in `main`
    median: float | None = None
    p99: float | None = None
    goal: str = ""
    met: bool | None = None  # None without a goal or without a figure
    reference: dict[str, float] = {}
    note: str = ""


class FigureGoal(msgspec.Struct, frozen=True, kw_only=True):
    """Upper bounds, and the least that a median may be, in the figure's unit."""

    median: float | None = None
    p99: float | None = None
    least: float | None = None  # of the median, where more is better

    def is_met(self, median: float, p99: float) -> bool:
        """True if no bound is passed; `median` and `p99` are in the figure's unit."""
        is_enough = self.least is None or median >= self.least
        return is_enough and median <= _or_infinity(self.median) and p99 <= _or_infinity(self.p99)

    def __str__(self) -> str:
        bounds = (("median >=", self.least), ("median <=", self.median), ("p99 <=", self.p99))
        return ", ".join(f"{name} {bound:.4g}" for name, bound in bounds if bound is not None)


class NotMeasured(Exception):
    """The figure cannot be measured on this machine; the text says why."""


def _or_infinity(bound: float | None) -> float:
    return math.inf if bound is None else bound


def of_samples(
    samples: Sequence[float],
    goal: FigureGoal | None = None,
    reference: Mapping[str, float] | None = None,
    note: str = "",
) -> Figure:
    """Median and 99th percentile of `samples`, compared with `goal`, all in the figure's unit; raises NotMeasured if
    there are no samples."""
    if not samples:
        raise NotMeasured("there was not a single sample")
    median, p99 = quantile(samples, 0.5), quantile(samples, 0.99)
    return Figure(
        median=rounded(median),
        p99=rounded(p99),
        goal="" if goal is None else str(goal),
        met=None if goal is None else goal.is_met(median, p99),
        reference={name: rounded(value) for name, value in (reference or {}).items()},
        note=note,
    )


def quantile(samples: Sequence[float], share: float) -> float:
    """The smallest sample that at least `share` (0 to 1) of all samples do not exceed."""
    ordered = sorted(samples)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def rounded(value: float) -> float:
    """`value`, in any unit, to four significant digits, which is more than the repeatability of any figure."""
    return float(f"{value:.4g}")


def guarded(measure: Callable[[], Figure], unit: str) -> Figure:
    """The figure with its unit; if `measure` raises, a figure without values whose note says why."""
    try:
        return msgspec.structs.replace(measure(), unit=unit)
    except NotMeasured as error:
        return Figure(unit=unit, note=f"not measured: {error}")
    except Exception as error:
        return Figure(unit=unit, met=False, note=f"failed: {type(error).__name__}: {error}")


class BenchReport(msgspec.Struct, frozen=True):
    """The content of `out/bench.json`."""

    commit: str
    machine: str
    figures: dict[str, Figure]


def report_of(figures: Mapping[str, Figure], root: Path) -> BenchReport:
    """The report of a run in the git repository `root`."""
    return BenchReport(commit(root), machine(), dict(figures))


def commit(root: Path) -> str:
    """The abbreviated hash of HEAD, with `+` appended if the working tree differs; "unknown" without git."""
    try:
        head = _git(root, "rev-parse", "--short=12", "HEAD")
        return head + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def machine() -> str:
    """Processor, cores, memory, system, Python version and load average; no host name."""
    memory = psutil.virtual_memory().total / 2**30
    return (
        f"{processor()}, {psutil.cpu_count()} cores, {memory:.0f} GiB, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}, load average at the end {psutil.getloadavg()[0]:.1f}"
    )


def processor() -> str:
    """The model name from /proc/cpuinfo, else what Python knows."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"


def text_of(report: BenchReport) -> str:
    """The table, followed by the note and the references of each figure."""
    rows = [
        (name, figure.unit, _number(figure.median), _number(figure.p99), figure.goal or "-", _verdict(figure))
        for name, figure in report.figures.items()
    ]
    details = [_detail(name, figure) for name, figure in report.figures.items() if figure.note or figure.reference]
    headings = ("figure", "unit", "median", "p99", "goal", "met")
    return f"{report.machine}, commit {report.commit}\n\n{table(headings, rows)}\n\n" + "\n".join(details)


def _detail(name: str, figure: Figure) -> str:
    """The note and the references, wrapped at 116 columns."""
    references = "; ".join(f"{what} {value:g}" for what, value in figure.reference.items())
    texts = [f"{name}: {figure.note}", *([references] if references else [])]
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
