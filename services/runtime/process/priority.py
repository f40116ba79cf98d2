"""The priority of a process among those of the stack."""

from __future__ import annotations

import os
from contextlib import suppress

# Chosen: a third of the processor time of a process at 0 where both want it all, and all of it where nobody else does.
BEHIND = 5  # niceness of what may wait: plans, recordings, pictures


def step_behind() -> None:
    """Lets the processes that a stop goes through (gateway, router, broker) run first, where the OS allows it."""
    with suppress(OSError):
        os.nice(max(0, BEHIND - os.nice(0)))
