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

from bed_firmware import Bed, open_bed  # noqa: E402


@pytest.fixture(scope="session", autouse=True)
def _core() -> None:
    subprocess.run([HERE.parents[1] / "firmware/bindings/build.sh"], check=True, capture_output=True)


@pytest.fixture
def bed(tmp_path: Path) -> Iterator[Bed]:
    with open_bed(tmp_path) as bed:
        yield bed
