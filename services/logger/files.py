"""Names, age and number of the files of a recording: an MCAP, and the CSV of commands beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

MCAP, CSV = ".mcap", ".csv"
_NAME = r"(\d{8}T\d{6}\.\d{3}Z_%s)(_\d+)?\.\w+"


def stem_of(robot: str, now: int) -> str:
    """For example `20261121T013306.250Z_rm1`: sorts by time; `now` in ns UNIX."""
    seconds, nanoseconds = divmod(now, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y%m%dT%H%M%S}.{nanoseconds // 1_000_000:03d}Z_{robot}"


def is_due(size: int, age: float, max_file_mb: float, max_age_minutes: float) -> bool:
    """True if a file of `size` [B] and `age` [s] is to be followed by a new one."""
    return size >= max_file_mb * 1e6 or age >= max_age_minutes * 60.0


def surplus(names: list[str], robot: str, keep: int, ours: Sequence[str] = ()) -> list[str]:
    """The files of all but the newest `keep` recordings of this robot; none where `keep` is 0.

    `ours` are the stems of those that the process has begun, which are the newest in this order, whatever their names
    say: a clock may have been set back.
    """
    matches = [re.fullmatch(_NAME % re.escape(robot), name) for name in sorted(names)]
    stems = [*sorted({match[1] for match in matches if match} - set(ours)), *ours]
    old = set(stems[:-keep]) if keep else set()
    return [match[0] for match in matches if match and match[1] in old]


def prune(
    folder: Path, robot: str, keep: int, ours: Sequence[str] = (), among: Iterable[str] | None = None
) -> list[str]:
    """Delete the surplus in `folder`, as `surplus` has it; returns what was deleted. What cannot be deleted stays.

    `among` are the names that count, else all.
    """
    names, deleted = [path.name for path in folder.iterdir()] if among is None else list(among), []
    for name in surplus(names, robot, keep, ours):
        try:
            (folder / name).unlink()
        except OSError:
            continue
        deleted.append(name)
    return deleted
