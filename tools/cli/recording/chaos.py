"""`gemelo chaos` and `gemelo soak`: each becomes a program of its own, which starts a stack of its own."""

from __future__ import annotations

import os
import sys

from gemelo.tools.chaos.options import add_chaos_options, add_soak_options
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.parser import Options

__all__ = ["add_chaos_options", "add_soak_options", "run_chaos", "run_soak"]


def run_chaos(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.tools.chaos` with the same options."""
    os.execv(sys.executable, [sys.executable, "-m", "gemelo.tools.chaos", *sys.argv[2:]])


def run_soak(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.tools.chaos.soak` with the same options."""
    os.execv(sys.executable, [sys.executable, "-m", "gemelo.tools.chaos.soak", *sys.argv[2:]])
