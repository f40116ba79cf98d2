"""`gemelo replay`: becomes a program of its own, which has the cores of the services."""

from __future__ import annotations

import os
import sys

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.parser import Options
from gemelo.tools.replay.options import add_options

__all__ = ["add_options", "run"]


def run(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.tools.replay` with the same options."""
    os.execv(sys.executable, [sys.executable, "-m", "gemelo.tools.replay", *options.behind])
