"""The priority of a process among those of the stack."""

from __future__ import annotations

import os
import sys
from contextlib import suppress

# Chosen: a third of the processor time of a process at 0 where both want it all, and all of it where nobody else does.
BEHIND = 5  # niceness of what may wait: plans, recordings, pictures
AHEAD = 1  # chosen: the lowest real-time priority, which is above everything that has none


def lower_priority() -> None:
    """Lets the processes that a stop goes through (gateway, router, broker) run first, where the OS allows it."""
    with suppress(OSError):
        os.nice(max(0, BEHIND - os.nice(0)))


def may_raise_priority() -> bool:
    """True if the OS would let `raise_priority` do so; nothing stays changed."""
    if sys.platform != "linux":
        return False
    policy, share = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(AHEAD))
    except OSError:
        return False
    os.sched_setscheduler(0, policy, share)
    return True


def raise_priority() -> bool:
    """Gives all threads of this process a real-time priority, so that a busy machine delays no heartbeat; true if so.

    The OS allows it to root and to whom `ulimit -r` does; without it the process runs on as it was. Linux keeps 5 % of
    the time for all else (`sched_rt_runtime_us`), and the threads that come later inherit it.
    """
    if sys.platform != "linux":
        return False
    for thread in os.listdir("/proc/self/task"):
        try:
            os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(AHEAD))
        except ProcessLookupError:
            continue  # it has just ended
        except OSError:
            return False
    return True
