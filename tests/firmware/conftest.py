"""The folder's helpers, importable by name, and a core that is built of the sources as they are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))


@pytest.fixture(scope="session", autouse=True)
def _core() -> None:
    subprocess.run([HERE.parents[1] / "firmware/bindings/build.sh"], check=True, capture_output=True)
