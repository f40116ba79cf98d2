"""The arm and the planner that these tests are about."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from schemas.joints import JointState
from services.arm.description import Arm, load_arm
from services.planner.core import Planner

settings.register_profile("gemelo", deadline=None)  # two cores, shared: time is measured by the bench
settings.load_profile("gemelo")


@pytest.fixture(scope="session")
def rm1() -> Arm:
    return load_arm(Path(__file__).parents[2] / "urdf" / "rm1")


@pytest.fixture(scope="session")
def planner(rm1: Arm) -> Planner:
    return Planner(rm1)


@pytest.fixture
def home(rm1: Arm) -> JointState:
    return JointState(name=rm1.joint_names, position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0))
