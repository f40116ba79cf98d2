"""Folders whose disk refuses to be written, and takes files again: full, read-only, or a file in the folder's place."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from gemelo.tools.chaos.small_disk import SmallDisk
from tests.optional import need_mounts

WAYS = ("full", "read-only", "replaced by a file")


@dataclass(frozen=True)
class Disk:
    """`folder` is on it; `refuse` and `take` may be called in turn, as often as one likes."""

    folder: Path
    refuse: Callable[[], None]
    take: Callable[[], None]


@contextmanager
def refusing_disk(way: str, folder: Path) -> Iterator[Disk]:
    """`folder` on a disk that refuses in one of the WAYS."""
    if way == "replaced by a file":
        folder.mkdir(parents=True, exist_ok=True)
        yield _replaced(folder)
        return
    need_mounts()
    with SmallDisk(folder) as disk:
        if way == "full":
            yield Disk(folder, disk.fill, disk.free)
        else:
            yield Disk(folder, disk.make_read_only, disk.make_writable)


def _replaced(folder: Path) -> Disk:
    aside = folder.with_name(f"{folder.name}.aside")

    def refuse() -> None:
        os.replace(folder, aside)
        folder.write_text("a file where the folder was")

    def take() -> None:
        folder.unlink()
        os.replace(aside, folder)

    return Disk(folder, refuse, take)
