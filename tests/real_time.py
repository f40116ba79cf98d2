"""The right to a real-time priority, as the OS gives it to a process here."""

from __future__ import annotations

import subprocess
import sys


def may_run_in_real_time() -> bool:
    """True if the OS says so to a program that asks for nothing else."""
    program = "import os; os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode == 0
