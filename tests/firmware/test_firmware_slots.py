"""A start whose files of firmware are missing, cut off or from another version: the other slot's, or one sentence."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
from update_bed import NAME, NEWER, ROOT, an_image, core_of

from gemelo.firmware.bindings.library import LIBRARY, LibraryMissing
from gemelo.firmware.platform.host.firmware_slots import FirmwareSlots
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from tests.disks import WAYS, refusing_disk

GONE = "replaced by a file"  # what was in the folder cannot be read either
NO_CORE = b"\x7fELF and nothing that can be loaded"


def slots(folder: Path) -> FirmwareSlots:
    return FirmwareSlots(folder, NAME, lambda: "", UnwrittenFiles(print))


def updated(folder: Path, image: bytes | None = None) -> FirmwareSlots:
    """A board that runs from slot 1 since an update."""
    folder.mkdir(exist_ok=True)
    (folder / f"{NAME}_ota_1.bin").write_bytes(an_image() if image is None else image)
    (folder / f"{NAME}_ota.json").write_text('{"slot": 1, "state": "valid"}')
    return slots(folder)


def test_a_library_that_was_removed_cut_off_or_replaced_is_made_again_from_its_image(tmp_path: Path) -> None:
    library = updated(tmp_path).boot().library
    assert library.read_bytes() == core_of(NEWER)
    for harm in (
        library.unlink,
        lambda: library.write_bytes(b""),
        lambda: library.write_bytes(LIBRARY.read_bytes()[:-9]),
    ):
        harm()
        assert slots(tmp_path).boot().slot == "ota_1"
        assert library.read_bytes() == core_of(NEWER)


@pytest.mark.parametrize("way", [way for way in WAYS if way != GONE])
def test_a_library_that_the_disk_refuses_is_started_from_memory(way: str, tmp_path: Path) -> None:
    with refusing_disk(way, tmp_path / "run") as disk:
        board = updated(disk.folder)
        disk.refuse()
        booted = board.boot()
        assert booted.slot == "ota_1"
        assert booted.library.read_bytes() == core_of(NEWER)
        assert not list(disk.folder.glob("*.so"))


@pytest.mark.parametrize("harm", ["missing", "cut off", "of another version"])
def test_a_firmware_that_cannot_be_started_leaves_the_start_to_the_other_slot(
    harm: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    board = updated(tmp_path, an_image(NO_CORE) if harm == "of another version" else None)
    image = tmp_path / f"{NAME}_ota_1.bin"
    if harm == "missing":
        image.unlink()
    elif harm == "cut off":
        image.write_bytes(image.read_bytes()[:10])
    with caplog.at_level(logging.ERROR, "virtual_esp32"):
        booted = board.boot()
    assert (booted.slot, booted.library) == ("ota_0", LIBRARY)
    assert f"the firmware in {image} cannot be started" in caplog.text
    assert "`gemelo device update` writes a new one" in caplog.text
    assert json.loads((tmp_path / f"{NAME}_ota.json").read_text())["slot"] == 0


def test_where_no_slot_can_be_started_the_process_ends_with_one_sentence_and_a_remedy(tmp_path: Path) -> None:
    board = updated(tmp_path / "run", an_image(NO_CORE))
    (tmp_path / f"run/{NAME}_ota_0.bin").write_bytes(an_image(NO_CORE))
    remedy = f"Remove {tmp_path / 'run' / NAME}_ota* to start with the one that is installed here"
    with pytest.raises(LibraryMissing) as error:
        board.boot()
    assert remedy in str(error.value)
    ended = subprocess.run(
        [sys.executable, "-m", "gemelo.services.virtual_esp32.main"], cwd=ROOT, capture_output=True, text=True,
        check=False, timeout=60.0, env={**os.environ, "GEMELO_PATHS_RUN": str(tmp_path / "run")},
    )  # fmt: skip
    assert ended.returncode == 1
    said = ended.stdout + ended.stderr
    assert remedy in said
    assert "Traceback" not in said
