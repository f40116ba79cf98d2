"""The planning processes that a test has started."""

from __future__ import annotations

import psutil

from gemelo.services.planner.workers.process import CHILD


def planning_processes(of: int | None = None) -> list[psutil.Process]:
    """Those of the process `of`, or of this one."""
    return [child for child in psutil.Process(of).children() if _plans(child)]


def _plans(child: psutil.Process) -> bool:
    """False for one that has ended, and for what other tests have left to run: a browser, Python's own helper."""
    try:
        return child.status() != psutil.STATUS_ZOMBIE and CHILD in child.cmdline()
    except psutil.NoSuchProcess:
        return False
