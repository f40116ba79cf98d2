"""The reason why a process is not ready: by process-compose, by the process itself, and its last lines."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import psutil

from gemelo.libraries.runtime.process.readiness import says_ready
from gemelo.tools.stack.compose import ProcessState

LINES = 8  # of a log that are shown


class NotReady(NamedTuple):
    """One process that is not ready."""

    name: str
    reason: str
    lines: tuple[str, ...]  # the last ones of its log, oldest first

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        said = f"its last lines: {' | '.join(self.lines)}" if self.lines else "it has printed nothing"
        return f"{self.name} is not ready: {self.reason}; {said}"

    def __str__(self) -> str:
        """The reason, and under it the lines."""
        return "\n".join([f"--- {self.name}: {self.reason}", *(self.lines or ("(it has printed nothing)",))])


def not_ready(name: str, state: ProcessState | None, run: Path, log: str) -> NotReady:
    """`state` is what process-compose says, None if it does not answer; `run` has the files of readiness."""
    lines = [line for line in log.splitlines() if line.strip()]
    return NotReady(name, reason_of(name, state, run), tuple(lines[-LINES:]))


def reason_of(name: str, state: ProcessState | None, run: Path) -> str:
    """One sentence without its end."""
    if state is None:
        return "process-compose does not say how it is"
    before = f", started anew {state.restarts} times, last exit code {state.exit_code}" if state.restarts else ""
    if not state.is_running:
        return f"it does not run ({state.status or 'no status'}{before or f', exit code {state.exit_code}'})"
    try:
        process = psutil.Process(state.pid)
        if process.status() == psutil.STATUS_STOPPED:
            return f"it is frozen (SIGSTOP): kill -CONT {state.pid} lets it go on"
        age, spent = time.time() - process.create_time(), sum(process.cpu_times()[:2])
    except psutil.Error:
        return f"it has just ended (process {state.pid}{before})"
    return f"{_said(name, run)} (process {state.pid}, for {age:.0f} s, {spent:.1f} s of CPU{before})"


def _said(name: str, run: Path) -> str:
    """What the process says itself by its files."""
    try:
        return (run / f"{name}.problem").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        pass
    if says_ready(run, name):
        return "it has become ready since"
    if (run / f"{name}.ready").exists():
        return "its loop stands still, it was ready before"
    return "it says no reason, as one that is still starting"
