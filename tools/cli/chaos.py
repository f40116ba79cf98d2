"""`gemelo chaos` and `gemelo soak`: each becomes a program of its own, which starts a stack of its own."""

from __future__ import annotations

import os
import sys

from gemelo.services.chaos.options import add_chaos_options, add_soak_options
from gemelo.tools.cli.errors import ExitCode
from gemelo.tools.cli.parser import Options

__all__ = ["add_chaos_options", "add_soak_options", "run_chaos", "run_soak"]


def run_chaos(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.services.chaos` with the same options."""
    os.execv(sys.executable, [sys.executable, "-m", "gemelo.services.chaos", *sys.argv[2:]])


def run_soak(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.services.chaos.soak` with the same options."""
    os.execv(sys.executable, [sys.executable, "-m", "gemelo.services.chaos.soak", *sys.argv[2:]])
