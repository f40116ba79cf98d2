"""`gemelo version`: the versions of gemelo, of its wire protocol and of Python."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from services.cli.errors import ExitCode
from services.cli.parser import Options

WIRE_PROTOCOL = 1  # firmware/PROTOCOL.md


def run(options: Options) -> ExitCode:
    """Prints one line."""
    print(version_text())
    return ExitCode.OK


def version_text() -> str:
    """The three versions as one line."""
    try:
        gemelo = version("gemelo")
    except PackageNotFoundError:
        gemelo = "(not installed)"
    return f"gemelo {gemelo}, wire protocol {WIRE_PROTOCOL}, Python {platform.python_version()}"
