"""A process without a free descriptor: it keeps those that it has, and gets no file, socket or pipe any more."""

from __future__ import annotations

import resource
from contextlib import suppress

LEAST = 3  # numbers: 0, 1 and 2 are in use for ever


def take_descriptors(pid: int) -> None:
    """The process gets no descriptor from now on; raises OSError where there is no such process."""
    _, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (LEAST, hard))


def give_descriptors(pid: int) -> None:
    """As many as the system allows it; nothing where there is no such process any more."""
    with suppress(ProcessLookupError):
        _, hard = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (min(hard, 4096) if hard > 0 else 4096, hard))
