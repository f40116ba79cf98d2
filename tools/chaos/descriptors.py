"""A process without a free descriptor: it keeps those that it has, and gets no file, socket or pipe any more."""

from __future__ import annotations

import itertools
import resource
from contextlib import suppress
from pathlib import Path

PLENTY = 4096
MOST = Path("/proc/sys/fs/nr_open")  # of what the kernel takes for a limit, whatever one was inherited


def take_descriptors(pid: int) -> None:
    """The process gets no further descriptor from now on; raises OSError where there is no such process."""
    used = {int(each.name) for each in Path(f"/proc/{pid}/fd").iterdir()}
    _limit(pid, next(number for number in itertools.count(3) if number not in used))


def give_descriptors(pid: int) -> None:
    """Enough of them again; nothing where there is no such process any more."""
    with suppress(ProcessLookupError):
        _limit(pid, PLENTY)


def _limit(pid: int, numbers: int) -> None:
    _, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    most = int(MOST.read_text())
    hard = most if hard == resource.RLIM_INFINITY else min(hard, most)
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (min(numbers, hard), hard))
