"""A robot's folder that a test may spoil."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def copy(rm1_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(rm1_folder, tmp_path / "rm1"))
