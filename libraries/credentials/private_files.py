"""Files that only their owner can read."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from gemelo.schemas.errors import ConfigurationError


class AccessError(ConfigurationError):
    """A broker or router that cannot be joined for what a file says; the text names the key or file and the remedy."""


def require_private(path: str) -> None:
    """Returns if only its owner can read the file; else raises `AccessError` with the remedy."""
    try:
        mode = stat.S_IMODE(os.stat(path).st_mode)
    except OSError as error:
        raise AccessError(f"cannot read {path}: {error.strerror}") from None
    if mode & 0o077:
        raise AccessError(f"{path} has mode {mode:03o}, so others can read the secret in it: chmod 600 {path}")


def write(path: Path, text: str) -> None:
    """Replaces a file that only its owner can read."""
    beside = path.with_name(f"{path.name}.new")
    beside.unlink(missing_ok=True)
    with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(beside, path)
