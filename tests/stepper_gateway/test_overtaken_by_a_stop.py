"""The gateway without a device: what a client asked for before its stop is refused, in whatever order it arrives."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.actions.keys import goal_request, result_request
from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.endpoints import info_request
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.actions import GoalRequest, ResultRequest, ResultResponse
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.device import DeviceCommandRequest, DeviceStopRequest, SpeedCommand, StopKind
from gemelo.schemas.gripper import GripperCommandGoal
from gemelo.schemas.message import Message, decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.system import Empty, Failure
from gemelo.schemas.topics import (
    ACTIONS,
    DEVICE_COMMAND,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    GATEWAY,
    GRIPPER_COMMAND,
)
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import BeganInput
from gemelo.services.stepper_gateway.ledger.ledger_file import LedgerFile
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.services.stepper_gateway.shell import Shell
from tests.runtime.support import ROOT, spinning, until

MOVING = (
    (goal_request(FOLLOW_JOINT_TRAJECTORY).key, FollowJointTrajectoryGoal()),
    (goal_request(GRIPPER_COMMAND).key, GripperCommandGoal()),
    (DEVICE_COMMAND.key, DeviceCommandRequest(command=SpeedCommand())),
)


@pytest.fixture
def client(tmp_path: Path) -> Iterator[MemoryBus]:
    """Of a bus on which a gateway without a device serves."""
    network = MemoryNetwork()
    deployment = Deployment(robot="urdf/rm1", paths=PathsSection(out=str(tmp_path / "out"), run=str(tmp_path / "run")))
    with ExitStack() as stack:
        node = Node(GATEWAY, deployment, robot="rm1", bus=MemoryBus(network), stop=ShutdownRequest())
        stack.callback(node.close)
        parameters = node.parameters(GatewayParameters)
        file = stack.enter_context(closing(LedgerFile(tmp_path / "run", "rm1", node.unwritten)))
        core = GatewayCore(load_arm(ROOT / "urdf/rm1"), 1, parameters.value)
        shell = Shell(node, core, BeganInput(1, parameters.value), parameters, file)
        stack.enter_context(spinning(node, shell.step))
        yield stack.enter_context(closing(MemoryBus(network)))


def asked_with(client: MemoryBus, key: str, wanted: Message) -> Message:
    """A goal as it is sent to the server of `key`; a command as it is."""
    for action in ACTIONS:
        if key == goal_request(action).key:
            answer = ask(client, result_request(action).key, ResultRequest())
            epoch = decode(ResultResponse, answer.payload).epoch
            goal = msgspec.Raw(encode(wanted))
            return GoalRequest(goal_id=type(wanted).__name__, client="test", goal=goal, epoch=epoch)
    return wanted


def ask(client: MemoryBus, key: str, question: Message, number: int = 0) -> BusReply:
    answers: list[BusReply | None] = []
    client.ask(key, type(question).__name__, encode(question), 20.0, answers.append, number=number)
    assert until(lambda: answers, 20.0)
    assert answers[0] is not None
    return answers[0]


@pytest.mark.parametrize(("key", "wanted"), MOVING, ids=[key for key, _ in MOVING])
@pytest.mark.parametrize("kind", StopKind)
def test_what_was_asked_before_a_stop_is_void_and_what_is_asked_after_it_is_not(
    client: MemoryBus, key: str, wanted: Message, kind: StopKind
) -> None:
    question = asked_with(client, key, wanted)
    before = client.take_number()
    stop = DeviceStopRequest(kind=kind)  # it is answered only when the device has been silent for long
    client.ask(DEVICE_STOP.key, type(stop).__name__, encode(stop), 20.0, lambda answer: None, True)
    ask(client, info_request(GATEWAY).key, Empty())  # this answer says that the stop has been handled
    refused = ask(client, key, question, before)
    assert not refused.ok
    said = decode(Failure, refused.payload)
    assert said.kind == "void"
    assert f"{kind} was asked for after it: ask again (this was request {before} of its client" in said.message
    assert ask(client, key, question).ok
