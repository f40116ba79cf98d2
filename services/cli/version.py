"""`gemelo version`."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

WIRE_PROTOCOL = 1  # firmware/PROTOCOL.md


def text() -> str:
    """One line."""
    try:
        gemelo = version("gemelo")
    except PackageNotFoundError:
        gemelo = "(not installed)"
    return f"gemelo {gemelo}, wire protocol {WIRE_PROTOCOL}, Python {platform.python_version()}"
