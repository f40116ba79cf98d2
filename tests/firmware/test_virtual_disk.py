"""The files of a virtual board on a disk that refuses: its position is kept or not believed, and it goes on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware.platform.host.memory import PositionStore, StoredPosition
from services.runtime.process import unwritten as attempts
from services.runtime.process.unwritten import UnwrittenFiles
from tests.disks import WAYS, Disk, refusing_disk

REFERENCE = (0, 0, 0)


@pytest.fixture(params=WAYS)
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Disk]:
    with refusing_disk(request.param, tmp_path / "run") as disk:
        yield disk


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing here waits for the next attempt."""
    monkeypatch.setattr(attempts, "RETRY", 0.0)


def position(steps: int, moving: bool = False) -> StoredPosition:
    return StoredPosition(device="rm1", steps=(steps, 0, 0), moving=moving, referenced=True, shaft=(steps, 0, 0))


def store(disk: Disk, reports: list[str] | None = None) -> PositionStore:
    return PositionStore(disk.folder / "virtual_esp32.json", "rm1", UnwrittenFiles((reports or []).append))


def test_a_position_that_cannot_be_written_ends_nothing_and_is_never_taken_for_another(disk: Disk) -> None:
    reports: list[str] = []
    memory = PositionStore(disk.folder / "virtual_esp32.json", "rm1", UnwrittenFiles(reports.append))
    memory.wake(REFERENCE)
    memory.keep(position(100))
    disk.refuse()
    memory.keep(position(150, moving=True))
    cut_off = store(disk).wake(REFERENCE)
    assert not cut_off.referenced or cut_off.reset_cause == "first_start", cut_off
    memory.keep(position(200))
    disk.take()
    memory.keep(position(200))
    kept = store(disk).wake(REFERENCE)
    assert (kept.steps, kept.referenced, kept.reset_cause) == ((200, 0, 0), True, "power_on")
    assert [("can be written again" in each) for each in reports] in ([], [False, True]), reports


def test_a_full_disk_has_the_room_that_the_position_had(tmp_path: Path) -> None:
    with refusing_disk("full", tmp_path / "run") as disk:
        memory = store(disk)
        memory.keep(position(100))
        disk.refuse()
        memory.keep(position(100, moving=True))
        assert store(disk).wake(REFERENCE).reset_cause == "lost_while_moving"
        memory.keep(position(-70_000))
        kept = store(disk).wake(REFERENCE)
        assert (kept.steps, kept.referenced) == ((-70_000, 0, 0), True)
        assert sorted(file.name for file in disk.folder.iterdir()) == ["ballast", "virtual_esp32.json"]


def test_a_device_that_wakes_on_a_read_only_disk_does_not_believe_what_may_be_older_than_its_last_move(
    tmp_path: Path,
) -> None:
    with refusing_disk("read-only", tmp_path / "run") as disk:
        store(disk).keep(position(100))
        disk.refuse()
        woken = store(disk).wake(REFERENCE)
        assert (woken.referenced, woken.shaft, woken.reset_cause) == (False, (100, 0, 0), "memory_unwritable")
