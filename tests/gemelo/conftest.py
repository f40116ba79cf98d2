"""A stack for all tests of a file, and the arm on it as a script has it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue

import pytest

import gemelo
from schemas.device import ShaftPositions
from services.stack.stack import Stack

NEEDED = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner")
BROKER = "mosquitto" if shutil.which("mosquitto", path="/usr/bin:/usr/sbin:/usr/local/sbin") else "amqtt"


@pytest.fixture(scope="module")
def robot() -> str:
    return "rm1"


@pytest.fixture(scope="module")
def twin(robot: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A stack; what connects in this process or in one that it starts finds it."""
    out = tmp_path_factory.mktemp("out")
    with (
        Stack(broker=BROKER, out=out, processes=NEEDED, environment={"GEMELO_ROBOT": f"urdf/{robot}"}) as stack,
        pytest.MonkeyPatch.context() as patch,
    ):
        for name, value in stack.deployment.items():
            patch.setenv(name, value)
        yield stack


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
