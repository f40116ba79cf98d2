"""Spheres of shapes on the disk: made once for a content, by whichever process needs them first.

A file's name is the hash of what it was made of and of the code that made it, so nothing in it can be out of date. It
is written beside and renamed, and begins with the hash of its content: what is damaged is made again.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.native.binding import motion

try:
    import fcntl
except ImportError:  # Windows: two processes may make the same spheres at a time
    fcntl = None  # type: ignore[assignment]

Array = NDArray[np.float64]

log = logging.getLogger(__name__)

FOLDER = "GEMELO_CACHE"  # environment variable: another folder than the platform's
# Tuning constants: chosen, where a line does not say measured or standard.
MOST_FILES = 1000  # the oldest are removed; chosen: some tens of megabytes on the disk
DIGEST = 32  # bytes of a SHA-256: standard


def cached_rows(content: bytes, make: Callable[[], Array]) -> Array:
    """The rows (m, n) that `make` gives for this content: from the disk, where some process has made them before."""
    path = cache_folder() / f"{_name_of(content)}.rows"
    found = _read(path)
    if found is not None:
        return found
    with _alone(path):
        found = _read(path)  # another process has made it meanwhile
        if found is not None:
            return found
        rows = make()
        _write(path, rows)
    return rows


def cache_folder() -> Path:
    """$GEMELO_CACHE, or `gemelo` in the platform's folder for what can be made again."""
    if os.environ.get(FOLDER):
        return Path(os.environ[FOLDER])
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "gemelo"


@cache
def maker() -> bytes:
    """The hash of the code that makes spheres, compiled and not."""
    here = Path(__file__).parent
    files = (Path(motion.__file__), here / "sphere_cover.py", here.parent / "collision_geometry" / "solids.py")
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).digest()


def _name_of(content: bytes) -> str:
    return hashlib.sha256(maker() + content).hexdigest()


def _read(path: Path) -> Array | None:
    """None where there is no such file, or none that can be used."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(content[DIGEST:]).digest() != content[:DIGEST]:
        log.warning("%s is damaged and is made again", path)
        return None
    rows: Array = np.load(io.BytesIO(content[DIGEST:]), allow_pickle=False)
    return rows


def _write(path: Path, rows: Array) -> None:
    """Whole or not at all; that there is no room is no reason not to plan."""
    packed = io.BytesIO()
    np.save(packed, rows, allow_pickle=False)
    content = packed.getvalue()
    try:
        handle, beside = tempfile.mkstemp(dir=path.parent, prefix=".")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(beside, path)
        except OSError:
            with suppress(OSError):
                os.unlink(beside)
            raise
        _prune(path.parent)
    except OSError as error:
        log.warning("%s cannot be written (%s): it is made again at the next start", path, error.strerror)


def _prune(folder: Path) -> None:
    files = sorted(folder.glob("*.rows"), key=lambda file: file.stat().st_mtime)
    for file in files[: max(0, len(files) - MOST_FILES)]:
        file.unlink(missing_ok=True)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """One process at a time, where the platform can: the lock ends with its process."""
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        lock = path.with_suffix(".lock").open("a")
    except OSError:
        yield
        return
    with lock:
        if fcntl is not None:
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    with suppress(OSError):
        path.with_suffix(".lock").unlink()
