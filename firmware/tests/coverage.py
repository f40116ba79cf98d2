"""`deploy/coverage`: line coverage of firmware/core by its tests; a line that none reaches is named with its reason.

The reasons stand in uncovered.toml, by the text of the line. A line without one, and a reason without its line, fail.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import msgspec

CORE = Path(__file__).resolve().parents[1] / "core"
REASONS = Path(__file__).with_name("uncovered.toml")

Place = tuple[str, str]  # file, text of the line


class CoveredLine(msgspec.Struct):
    """How often gcov saw a line run, in one of its functions."""

    line_number: int
    count: int


class CoveredSource(msgspec.Struct):
    """A file, of the core or not."""

    file: str
    lines: list[CoveredLine]


class Unit(msgspec.Struct):
    """What gcov says of one object file."""

    current_working_directory: str
    files: list[CoveredSource]


class Uncovered(msgspec.Struct, forbid_unknown_fields=True):
    """A line that no test reaches, and why not."""

    file: str
    text: str
    reason: str


class UncoveredTable(msgspec.Struct, forbid_unknown_fields=True):
    """uncovered.toml."""

    line: list[Uncovered] = []


def main() -> int:
    counts = measured(Path(sys.argv[1]).resolve())
    if not counts:
        print(f"coverage: no data of {CORE.name} in {sys.argv[1]}", file=sys.stderr)
        return 1
    for name in sorted({name for name, _ in counts}):
        print(f"  {name:22}{share(counts, name):6.1f} %")
    print(f"coverage: {share(counts):.2f} % of {len(counts)} lines of firmware/core")
    faults = differences(missed(counts), reasons())
    for fault in faults:
        print(f"coverage: FAILED: {fault}", file=sys.stderr)
    return 1 if faults else 0


def measured(build: Path) -> Counter[tuple[str, int]]:
    """How often each line of the core ran, by file and number, over all test programs below `build`."""
    counts: Counter[tuple[str, int]] = Counter()
    for data in sorted(build.rglob("*.gcda")):
        done = subprocess.run(
            ["gcov", "--json-format", "--stdout", data], capture_output=True, check=True, cwd=build
        )  # fmt: skip
        unit = msgspec.json.decode(done.stdout, type=Unit)
        for source in unit.files:
            path = (Path(unit.current_working_directory) / source.file).resolve()
            if path.parent == CORE:
                for line in source.lines:
                    counts[path.name, line.line_number] += line.count
    return counts


def share(counts: Counter[tuple[str, int]], name: str | None = None) -> float:
    """Per cent of the lines, of one file or of all."""
    chosen = [count for (file, _), count in counts.items() if name in (None, file)]
    return 100.0 * sum(count > 0 for count in chosen) / len(chosen)


def missed(counts: Counter[tuple[str, int]]) -> Counter[Place]:
    """The lines that never ran, by their text."""
    texts = {name: (CORE / name).read_text().splitlines() for name, _ in counts}
    return Counter((name, texts[name][number - 1].strip()) for (name, number), n in counts.items() if n == 0)


def reasons() -> Counter[Place]:
    table = msgspec.convert(tomllib.loads(REASONS.read_text()), UncoveredTable)
    return Counter((line.file, line.text) for line in table.line if line.reason)


def differences(uncovered: Counter[Place], explained: Counter[Place]) -> list[str]:
    """Sentences: lines without a reason, and reasons whose line is reached or gone."""
    bare = [
        f'{file}: no test reaches "{text}" and uncovered.toml has no reason' for file, text in uncovered - explained
    ]
    stale = [
        f'{file}: "{text}" is reached or gone; take it out of uncovered.toml' for file, text in explained - uncovered
    ]
    return sorted(bare) + sorted(stale)


if __name__ == "__main__":
    sys.exit(main())
