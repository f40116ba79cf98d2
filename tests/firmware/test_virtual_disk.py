"""The files of a virtual board on a disk that refuses: its position is kept or not believed, and it goes on."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from bed_firmware import Bed, open_bed, wait_for

from gemelo.firmware.platform.host.memory import PositionStore, StoredPosition
from gemelo.libraries.runtime.process import unwritten as attempts
from gemelo.libraries.runtime.process.readiness import says_ready
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.tools.chaos.descriptors import give_descriptors, take_descriptors
from tests.disks import WAYS, Disk, refusing_disk

REFERENCE = (0, 0, 0)
NO_DESCRIPTORS = "no descriptors"


@pytest.fixture(params=WAYS)
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Disk]:
    with refusing_disk(request.param, tmp_path / "run") as disk:
        yield disk


@contextmanager
def trouble(way: str, folder: Path) -> Iterator[Disk]:
    """A disk that refuses in this way; a sound one where the process gets no descriptors."""
    if way == NO_DESCRIPTORS:
        yield Disk(folder, lambda: None, lambda: None)
        return
    with refusing_disk(way, folder) as disk:
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


def stored(bed: Bed) -> object:
    """The steps that the board's file has; None where there is none, or nothing in it."""
    with suppress(OSError, ValueError):
        return bed.memory()["steps"]
    return None


@pytest.mark.parametrize("way", [*WAYS, NO_DESCRIPTORS])
def test_a_device_that_moves_goes_on_while_it_can_write_nothing_and_keeps_its_position_afterwards(
    tmp_path: Path, way: str
) -> None:
    with trouble(way, tmp_path / "run") as disk, open_bed(tmp_path) as bed:
        bed.start_device()
        process = bed.process
        assert process is not None
        with bed.beating():
            assert bed.move(400, 1.0)[20] == 0
            if way == NO_DESCRIPTORS:
                take_descriptors(process.pid)
            disk.refuse()
            assert bed.event("finished")["stream"] == 1
            assert bed.move(100, 1.0, start=400, stream=2)[20] == 0
            assert bed.event("finished")["stream"] == 2
        wait_for(lambda: says_ready(disk.folder, "virtual_esp32"), "readiness")
        disk.take()
        give_descriptors(process.pid)
        wait_for(lambda: stored(bed) == [100, 0, 0], "the position on the disk")
        assert process.poll() is None
        assert bed.end_device(signal.SIGTERM) == 0
        bed.start_device()
        assert bed.status["referenced"] is True


@pytest.mark.parametrize("way", ["full", "read-only"])
def test_a_device_starts_on_a_disk_that_refuses_and_says_what_it_cannot_write(tmp_path: Path, way: str) -> None:
    with trouble(way, tmp_path / "run") as disk, open_bed(tmp_path) as bed:
        disk.refuse()
        bed.start_device()
        wait_for(lambda: says_ready(disk.folder, "virtual_esp32"), "readiness")
        with bed.beating():
            assert bed.move(200, 0.5)[20] == 0
            assert bed.event("finished")["stream"] == 1
        for what in ("the readiness of virtual_esp32 in", "the position of rm1 in"):
            assert bed.log.count(what) == 1, bed.log
        disk.take()
        wait_for(lambda: stored(bed) == [200, 0, 0], "the position on the disk")
