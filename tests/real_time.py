"""Whether a process may have a real-time priority here."""

from __future__ import annotations

import subprocess
import sys


def may_run_in_real_time() -> bool:
    """As the OS says to a program that asks for nothing else."""
    program = "import os; os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))"
    return subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode == 0
