"""A simulated arm for all tests of a file, as a script has it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from tests.simulated import found_by_connect, make_ready


@pytest.fixture(scope="module")
def simulated() -> Iterator[SimulatedArm]:
    """What calls `gemelo.connect()` in this process finds it."""
    with gemelo.simulate("rm1") as arm, found_by_connect(arm):
        yield arm


@pytest.fixture
def arm(simulated: SimulatedArm) -> SimulatedArm:
    """Referenced, armed and at rest, with an empty scene."""
    make_ready(simulated)
    return simulated


@pytest.fixture(scope="session")
def root() -> Path:
    return Path(__file__).parents[2]
