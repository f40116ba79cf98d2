"""The folder's helpers, importable by name, and a core that is built of the sources as they are."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))

from bed_firmware import Bed  # noqa: E402


@pytest.fixture(scope="session", autouse=True)
def _core() -> None:
    subprocess.run([HERE.parents[1] / "firmware/bindings/build.sh"], check=True, capture_output=True)


@pytest.fixture
def bed(tmp_path: Path) -> Iterator[Bed]:
    """A broker with a client that listens; the device is still off."""
    bed = Bed(tmp_path)
    try:
        bed.start_broker()
        bed.listen()
        yield bed
    finally:
        bed.close()
