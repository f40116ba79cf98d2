"""The end of a process whose threads may still be in the middle of something."""

from __future__ import annotations

import atexit
import os
import sys
from contextlib import suppress
from typing import NoReturn


def end_process(code: int) -> NoReturn:
    """Ends the process with `code` after its exit handlers, everything flushed, and without Python's own finalization.

    That aborts the process ("FATAL: exception not rethrown") where a thread of a library or of a node calls into it at
    that moment; and whatever such a thread still holds of ruckig's or of the motion core's, nanobind would call a leak.
    """
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # the reader has gone
            stream.flush()
    os._exit(code)
