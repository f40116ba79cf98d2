"""The planner that these tests are about."""

from __future__ import annotations

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.services.planner.core import Planner
from tests.planner.judging import forget_scenes


@pytest.fixture(scope="session")
def planner(rm1: ArmDescription) -> Planner:
    return Planner(rm1)


@pytest.fixture
def home(rm1: ArmDescription) -> JointState:
    return JointState(name=rm1.joint_names, position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0))


@pytest.fixture(autouse=True)
def scenes_of_other_tests() -> None:
    """Tests of all files share planners, in any order."""
    forget_scenes()
