"""Files that only their owner can read."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import because


class AccessError(ConfigurationError):
    """A broker or router that cannot be joined for what a file says; the text names the key or file and the remedy."""


def unreadable(file: str | Path, error: OSError) -> AccessError:
    """The error of a file that the system does not read."""
    return AccessError(because("certificate.unreadable", file=str(file), error=error.strerror or str(error)))


def require_private(path: str) -> None:
    """Returns if only its owner can read the file; else raises `AccessError` with the remedy."""
    try:
        mode = stat.S_IMODE(os.stat(path).st_mode)
    except OSError as error:
        raise unreadable(path, error) from None
    if mode & 0o077:
        raise AccessError(because("certificate.mode", file=str(path), mode=f"{mode:03o}"))


def write(path: Path, text: str) -> None:
    """Replaces a file that only its owner can read."""
    beside = path.with_name(f"{path.name}.new")
    beside.unlink(missing_ok=True)
    with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(beside, path)
