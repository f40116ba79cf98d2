"""`gemelo version`: the versions of gemelo, of its wire protocol and of Python."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.parser import Options

WIRE_PROTOCOL = 1  # firmware/PROTOCOL.md


def run(options: Options) -> ExitCode:
    """Prints one line."""
    print(version_text())
    return ExitCode.OK


def version_text() -> str:
    """The three versions as one line."""
    return f"gemelo {gemelo_version()}, wire protocol {WIRE_PROTOCOL}, Python {platform.python_version()}"


def gemelo_version() -> str:
    """That of the package."""
    try:
        return version("gemelo")
    except PackageNotFoundError:
        return "(not installed)"
