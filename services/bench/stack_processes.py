"""The processes of a running stack, with whatever they have started."""

from __future__ import annotations

import psutil

from services.stack.stack import Stack


def families(stack: Stack) -> dict[str, list[psutil.Process]]:
    """By the name in process-compose.yaml: the process and its children."""
    found = {}
    for name, pid in sorted(stack.pids().items()):
        process = psutil.Process(pid)
        found[name] = [process, *process.children(recursive=True)]
    return found


def cpu_seconds(processes: list[psutil.Process]) -> float:
    """[s] of processor time that they have used so far."""
    return sum(float(t.user + t.system) for t in (process.cpu_times() for process in processes))


def rss_mb(processes: list[psutil.Process]) -> float:
    """[MB] resident; what several share is counted for each."""
    return sum(float(process.memory_info().rss) for process in processes) / 1e6
