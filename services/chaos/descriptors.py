"""A process without a free descriptor: it keeps those that it has, and gets no file, socket or pipe any more."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path

LEAST = 3  # numbers: 0, 1 and 2 are in use for ever
PLENTY = 4096
MOST = Path("/proc/sys/fs/nr_open")  # of what the kernel takes for a limit, whatever one was inherited


def take_descriptors(pid: int) -> None:
    """The process gets no descriptor from now on; raises OSError where there is no such process."""
    _limit(pid, LEAST)


def give_descriptors(pid: int) -> None:
    """Enough of them again; nothing where there is no such process any more."""
    with suppress(ProcessLookupError):
        _limit(pid, PLENTY)


def _limit(pid: int, numbers: int) -> None:
    _, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    most = int(MOST.read_text())
    hard = most if hard == resource.RLIM_INFINITY else min(hard, most)
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (min(numbers, hard), hard))
