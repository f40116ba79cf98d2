"""Both arms and their cores, built once: the spheres take a second."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.services.planner.native.native_planner import NativePlanner

ARMS = ("rm1", "parol6")


@cache
def load(name: str) -> ArmDescription:
    return load_arm(Path(__file__).parents[3] / "urdf" / name)


@pytest.fixture(params=ARMS)
def arm(request: pytest.FixtureRequest) -> ArmDescription:
    return load(request.param)


@pytest.fixture
def core(arm: ArmDescription) -> NativePlanner:
    """A core of its own for each test, which may change its scene."""
    return NativePlanner(arm)


@pytest.fixture
def configurations(arm: ArmDescription) -> Callable[[int, int], NDArray[np.float64]]:
    """(count, seed) -> random configurations (count, n) within the limits."""
    lower = np.array([max(joint.lower, -np.pi) for joint in arm.joints])
    upper = np.array([min(joint.upper, np.pi) for joint in arm.joints])
    return lambda count, seed: np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))
