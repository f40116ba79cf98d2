"""The arm that these tests are about."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from services.arm.description import Arm, load_arm

settings.register_profile("gemelo", deadline=None)  # two cores, shared: time is measured by the bench
settings.load_profile("gemelo")


@pytest.fixture(scope="session")
def rm1_folder() -> Path:
    return Path(__file__).parents[2] / "urdf" / "rm1"


@pytest.fixture(scope="session")
def rm1(rm1_folder: Path) -> Arm:
    return load_arm(rm1_folder)
