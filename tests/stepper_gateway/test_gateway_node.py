"""The gateway as a node: its action, its requests and its topics on a bus, with a real broker and device."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.errors import GoalRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import (
    ConfigureRequest,
    DeviceCommandRequest,
    InjectKind,
    InjectRequest,
    ReferenceCommand,
    ResetCommand,
    ResumeCommand,
)
from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.message import encode
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_CONFIGURE,
    DEVICE_INJECT,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_STATES,
    JOINT_TARGETS,
    SCENE,
)
from gemelo.services.stepper_gateway.main import run
from tests.stepper_gateway.harness import move
from tests.stepper_gateway.processes import DEVICE, Processes


class Running:
    """The gateway's node in a thread, and a client's node."""

    def __init__(self, processes: Processes) -> None:
        network = self._network = MemoryNetwork()
        self._stop = ShutdownRequest()
        self.gateway = Node(
            "stepper_gateway", processes.deployment, robot="rm1", bus=MemoryBus(network), stop=self._stop
        )
        self._thread = threading.Thread(target=run, args=(self.gateway, processes.deployment))
        self._thread.start()
        self.client = Node("client", processes.deployment, robot="rm1", bus=MemoryBus(network), stop=ShutdownRequest())
        self.planner = Node(
            "planner", processes.deployment, robot="rm1", bus=MemoryBus(network), stop=ShutdownRequest()
        )
        self.joints = self.client.latest(JOINT_STATES)

    def network_bus(self) -> MemoryBus:
        """For a participant that is no node."""
        return MemoryBus(self._network)

    def until(self, is_true: Callable[[], bool], timeout: float = 60.0) -> None:
        end = time.monotonic() + timeout
        while not is_true():
            assert time.monotonic() < end
            self.client.wait(0.02)

    @property
    def here(self) -> JointState:
        assert self.joints.message is not None
        return self.joints.message

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=60.0)
        assert not self._thread.is_alive()
        self.client.close()
        self.planner.close()
        self.gateway.close()


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Running]:
    with closing(Processes("mosquitto", tmp_path)) as processes:
        processes.start_broker()
        processes.start(DEVICE)
        with closing(Running(processes)) as found:
            found.until(lambda: found.gateway.is_ready and found.joints.message is not None)
            yield found


def test_a_client_moves_cancels_streams_and_commands(running: Running) -> None:
    action = running.client.action(FOLLOW_JOINT_TRAJECTORY)
    feedback: list[float] = []
    goal = FollowJointTrajectoryGoal(trajectory=move((0.0, 0.0, 0.0), (0.1, -0.2, 0.01)))
    outcome = action.send(goal, lambda f: feedback.append(f.elapsed)).wait(20.0)
    assert outcome.status == GoalStatusCode.SUCCEEDED
    assert outcome.result.executed_steps == (297, -13, 28)
    assert len(feedback) > 5

    with pytest.raises(GoalRefused) as refused:
        action.send(goal)
    assert refused.value.code == FollowErrorCode.INVALID_GOAL
    assert "brazo_joint" in str(refused.value)

    running.until(lambda: running.here.position[0] > 0.099)
    handle = action.send(FollowJointTrajectoryGoal(trajectory=move(running.here.position, (1.0, 1.0, 0.1))))
    running.client.wait(0.8)
    handle.cancel()
    assert handle.wait(60.0).status == GoalStatusCode.CANCELED

    # No planner looks at the way of streamed targets here.
    running.gateway.post(lambda: running.gateway.set_parameter("watch_streams", False))
    for _ in range(20):
        running.client.publisher(JOINT_TARGETS).put(JointTargets(name=("brazo_joint",), position=(0.3,)))
        running.client.wait(0.1)
    assert running.here.position[0] == pytest.approx(0.3, abs=0.01)
    running.client.wait(1.5)
    answer = running.client.call(DEVICE_COMMAND, DeviceCommandRequest(command=ResumeCommand()), 3.0)
    assert not answer.accepted
    assert "NOT_READY" in answer.reason
    answer = running.client.call(DEVICE_COMMAND, DeviceCommandRequest(command=ReferenceCommand()), 3.0)
    assert answer.accepted
    running.until(lambda: running.here.position == (0.0, 0.0, 0.0))
    assert running.client.call(DEVICE_CONFIGURE, ConfigureRequest(), 8.0).accepted
    pressed = running.client.call(DEVICE_INJECT, InjectRequest(kind=InjectKind.ESTOP), 5.0)
    assert pressed.accepted, pressed.reason
    answer = running.client.call(DEVICE_COMMAND, DeviceCommandRequest(command=ResetCommand()), 3.0)
    assert "release it" in answer.reason


def test_the_scene_of_the_bus_decides_which_plans_are_followed(running: Running) -> None:
    running.planner.publisher(SCENE).put(PlanningScene(version=4, epoch=9))
    running.client.wait(0.2)
    action = running.client.action(FOLLOW_JOINT_TRAJECTORY)
    trajectory = move((0.0, 0.0, 0.0), (0.1, -0.2, 0.01))
    with pytest.raises(GoalRefused, match="planned in scene version 3, the scene is version 4 now") as refused:
        action.send(FollowJointTrajectoryGoal(trajectory=trajectory, scene_version=3))
    assert refused.value.code == FollowErrorCode.SCENE_CHANGED
    outcome = action.send(FollowJointTrajectoryGoal(trajectory=trajectory, scene_version=4)).wait(20.0)
    assert outcome.status == GoalStatusCode.SUCCEEDED


def test_a_stray_scene_blocks_no_planned_move(running: Running) -> None:
    """Valid scenes of no node and of another node, before the planner's own and after it."""
    anybody = running.network_bus().publish(SCENE.key, "PlanningScene", SCENE.delivery)
    versions = (2**31, -(2**62), 5, 0)
    strays = [PlanningScene(version=version, epoch=epoch) for version in versions for epoch in (0, 9)]
    for stray in strays[:4]:
        anybody.put(encode(stray))
    running.planner.publisher(SCENE).put(PlanningScene(version=4, epoch=9))
    for stray in strays:
        anybody.put(encode(stray))
        running.client.publisher(SCENE).put(stray)
    action = running.client.action(FOLLOW_JOINT_TRAJECTORY)
    trajectory = move((0.0, 0.0, 0.0), (0.1, -0.2, 0.01))
    goal = FollowJointTrajectoryGoal(trajectory=trajectory, scene_version=4, scene_epoch=9)
    assert action.send(goal).wait(20.0).status == GoalStatusCode.SUCCEEDED
