"""The arm on the shared stack, as a script has it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue

import pytest

import gemelo
from schemas.device import ShaftPositions
from services.stack.stack import Stack
from tests.stacks.shared import found_by_scripts


@pytest.fixture(scope="module")
def twin(rm1_stack: Stack) -> Iterator[Stack]:
    """The shared stack; what connects in this process or in one that it starts finds it."""
    with found_by_scripts(rm1_stack):
        yield rm1_stack


@pytest.fixture
def arm(twin: Stack) -> Iterator[gemelo.Arm]:
    """Referenced, armed and at rest, with an empty scene."""
    twin.wait_ready(20.0)
    with gemelo.connect(timeout=10.0) as connected:
        make_ready(connected)
        yield connected


def make_ready(arm: gemelo.Arm) -> None:
    """Does what a person would do after whatever a test has left."""
    if arm.device.mode is gemelo.DeviceMode.HOLD:
        arm.stop()
    if not arm.device.state.armed:
        arm.device.arm()
    if not all(arm.device.state.referenced):
        arm.reference(where_it_stands(arm))
    arm.speed(1.0)
    arm.scene.clear()


def where_it_stands(arm: gemelo.Arm) -> dict[str, float]:
    """A person looks at the arm before declaring: a virtual one says where its shafts are."""
    shafts: SimpleQueue[ShaftPositions] = SimpleQueue()
    arm.node.subscribe(gemelo.topics.DEVICE_SHAFT, shafts.put)
    shaft = shafts.get(timeout=5.0)
    return {name: arm.description.joint(name).clamp(at) for name, at in zip(shaft.name, shaft.position, strict=True)}


@pytest.fixture(scope="session")
def root() -> Path:
    return Path(__file__).parents[2]
