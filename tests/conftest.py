"""The arm most tests are about, and property tests that run the same examples everywhere.

HYPOTHESIS_PROFILE=explore looks for new examples.
"""

from __future__ import annotations

import gc
import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers

from services.arm.model.description import ArmDescription, load_arm

# A run in the background begins with Ctrl-C ignored, and every process that a test starts would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# No deadline: two cores, shared; time is measured by the bench.
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
profile = os.environ.get("HYPOTHESIS_PROFILE", "same")
settings.load_profile(profile)
if profile == "same":  # not those with the numbers of whatever modules happen to be loaded
    providers._get_local_constants = lambda: providers._local_constants


@pytest.fixture(scope="session")
def rm1_folder() -> Path:
    return Path(__file__).parents[1] / "urdf" / "rm1"


@pytest.fixture(scope="session")
def rm1(rm1_folder: Path) -> ArmDescription:
    return load_arm(rm1_folder)


def pytest_collection_finish() -> None:
    """What tests and libraries are made of stays: up to a tenth of the time went into looking for garbage there."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 100)


def pytest_sessionfinish() -> None:
    """What stayed is garbage now: nanobind tells on leaving whatever of its own is still there."""
    gc.unfreeze()
