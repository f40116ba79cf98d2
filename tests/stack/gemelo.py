"""The command line, as a person types it, on a stack."""

from __future__ import annotations

import subprocess
import sys

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.stack.stack import Stack

LONGEST = 120.0  # [s] of one command
COMMAND = (sys.executable, "-m", "gemelo.tools.cli.main")


def gemelo(stack: Stack, *words: str, code: ExitCode = ExitCode.OK) -> str:
    """Everything that the command has printed; it must end with `code`."""
    done = subprocess.run(
        [*COMMAND, *words],
        cwd=stack.root, env=stack.environment, capture_output=True, text=True, timeout=LONGEST, check=False,
    )  # fmt: skip
    assert done.returncode == code, f"{words} ended with {done.returncode}:\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr
