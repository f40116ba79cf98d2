"""Files and folders of one user alone: what an arm did, and images of its room, are nobody else's to read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO


def own_file(path: str, flags: int) -> int:
    """An opener for `open`: a file that it makes has mode 600; the mode of one that is there stays."""
    return os.open(path, flags, 0o600)


def created(path: Path) -> BinaryIO:
    """A new file of mode 600 to write to; raises FileExistsError."""
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb")


def own_folder(path: Path) -> None:
    """Makes it with mode 700, where it is not there; folders above it have the usual one."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)


def make_own(path: Path) -> None:
    """An empty file of mode 600 for a library that opens it itself; one that is there stays as it is."""
    open(path, "ab", opener=own_file).close()
