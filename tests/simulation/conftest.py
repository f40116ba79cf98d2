"""A simulated rm1 at its reference pose, for tests that move it as they like: each gets one of its own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import gemelo


@pytest.fixture
def arm() -> Iterator[gemelo.SimulatedArm]:
    with gemelo.simulate("rm1") as simulated:
        yield simulated
