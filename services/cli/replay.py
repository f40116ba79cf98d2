"""`gemelo replay`: becomes a program of its own, which has the cores of the services."""

from __future__ import annotations

import os
import sys

from services.cli.errors import ExitCode
from services.cli.parser import Options
from services.replay.options import add_options

__all__ = ["add_options", "run"]


def run(options: Options) -> ExitCode:
    """Becomes `python -m services.replay` with the same options."""
    os.execv(sys.executable, [sys.executable, "-m", "services.replay", *sys.argv[2:]])
