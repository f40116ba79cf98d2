"""Scripts as users write them, in processes of their own."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager

from gemelo.tools.stack.stack import Stack

LONGEST = 60.0  # [s]


@contextmanager
def script(twin: Stack, text: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """A program that runs `text`; ended at the latest with the block."""
    process = subprocess.Popen(
        [sys.executable, *options, "-c", textwrap.dedent(text)],
        cwd=twin.root, env=twin.environment, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def said(process: subprocess.Popen[str]) -> str:
    """The next line that the script prints."""
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line, process.stderr.read() if process.stderr else ""
    return line.rstrip("\n")


def ended(process: subprocess.Popen[str], stdin: str | None = None) -> tuple[int, str, str]:
    """Exit code and what else was printed to both streams, when it ends by itself."""
    output, errors = process.communicate(stdin, timeout=LONGEST)
    return process.returncode, output, errors
