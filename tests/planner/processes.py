"""The planning processes that a test has started."""

from __future__ import annotations

import psutil


def planning_processes(of: int | None = None) -> list[psutil.Process]:
    """Those of the process `of`, or of this one."""
    return [child for child in psutil.Process(of).children() if _plans(child)]


def _plans(child: psutil.Process) -> bool:
    """False for one that has ended, and for the helper that Python starts for other processes, as those of a fit."""
    try:
        return child.status() != psutil.STATUS_ZOMBIE and "resource_tracker" not in " ".join(child.cmdline())
    except psutil.NoSuchProcess:
        return False
