"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

from gemelo.api.errors import Error
from gemelo.schemas.reasons import because


def write_whole(path: Path, content: bytes) -> None:
    """All or nothing: into a file beside it, which then takes its name. Makes the folder; raises `Error`, also where
    `path` is a folder or a device, whose place no file takes; where it is a link, what it points to is written."""
    path = path.resolve()
    if path.exists() and not path.is_file():
        raise Error(because("client.file.in_the_way", path=str(path)))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, beside = tempfile.mkstemp(prefix=".", suffix=".tmp", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(beside, 0o644)
            os.replace(beside, path)
        except BaseException:
            with suppress(OSError):
                Path(beside).unlink()
            raise
    except OSError as error:
        raise Error(because("client.file.unwritable", path=str(path), error=str(error.strerror))) from error
