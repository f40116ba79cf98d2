"""A twin in virtual time with the bridge as one of its services, and a client of ROS in real time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from gemelo.api.arm import Arm
from gemelo.api.session import Session
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.ros2.types import FOLLOW, make, ros_type
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.libraries.runtime.ros_wire.names import DEFAULT, EntityKind, NodeName, endpoint_token, gid_of
from gemelo.schemas.deployment import RosSection
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.services.ros_bridge.core import uuid_of
from gemelo.services.ros_bridge.main import node_name, run
from gemelo.tools.simulation.twin import ServiceNode, Twin
from gemelo.tools.simulation.virtual_clock import VirtualClock
from tests.ros_bridge.ros_client import Asked, RosClient, ros_router
from tests.ros_bridge.ros_goals import ros_goal

ACTION = "/arm_controller/follow_joint_trajectory/_action"
LONGEST = 60.0  # [s] of real time


class RosTwin:
    """What a test has of both sides."""

    def __init__(self, twin: Twin, operator: Node, watcher: Node, client: RosClient) -> None:
        """`operator` is the bridge's node, `watcher` that of `arm`."""
        self.clock, self.twin, self.operator, self.watcher, self.client = twin.clock, twin, operator, watcher, client
        self.cut_router: Callable[[], None] = lambda: None
        self.arm = Arm(Session(twin.deployment, twin.arm, watcher))

    def run_until(self, is_so: Callable[[], object], step: float = 0.001) -> bool:
        """Lets virtual time pass, in steps [s], until something of the other side has come.

        No faster than real time with the usual step, so that what is under way in Zenoh's threads is not overtaken.
        """
        end = time.monotonic() + LONGEST
        while not is_so():
            if time.monotonic() > end:
                return False
            self.clock.sleep(step)
            time.sleep(0.001)
        return True

    def answer(self, asked: Asked, step: float = 0.001) -> Any:
        assert self.run_until(lambda: asked.is_over, step)
        return asked.response()

    def result(self, number: bytes) -> Any:
        """How the goal ends, twenty times as fast."""
        return self.answer(self.ask_result(number), 0.02)

    def call(self, name: str, kind: str, gid: bytes = b"", **fields: Any) -> Any:
        return self.answer(self.client.begin(name, kind, gid, **fields))

    def send_goal(self, uuid: bytes, goal: FollowJointTrajectoryGoal, gid: bytes = b"") -> Any:
        """The decision upon a goal of the arm."""
        kind = f"{FOLLOW}_SendGoal"
        return self.call(f"{ACTION}/send_goal", kind, gid, goal_id=uuid_of(uuid), goal=ros_goal(goal))

    def ask_result(self, uuid: bytes, gid: bytes = b"") -> Asked:
        return self.client.begin(f"{ACTION}/get_result", f"{FOLLOW}_GetResult", gid, goal_id=uuid_of(uuid))

    def cancel(self, uuid: bytes = bytes(16), stamp: Any = None) -> Any:
        """The answer of cancel_goal."""
        zero = make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        info = make("action_msgs/msg/GoalInfo", goal_id=uuid_of(uuid), stamp=stamp or zero)
        return self.call(f"{ACTION}/cancel_goal", "action_msgs/srv/CancelGoal", goal_info=info)


@contextmanager
def ros_twin(folder: Path, robot: str = "rm1", **section: Any) -> Iterator[RosTwin]:
    """Ready: the action's server is seen by the client."""
    description, clock = load_arm(project_root() / f"urdf/{robot}"), VirtualClock()
    with ExitStack() as routers, ExitStack() as clients:
        locator = routers.enter_context(ros_router())
        client = clients.enter_context(RosClient(locator))
        settings = RosSection(router=locator, **({"motion": True} | section))
        deployment = replace(load_deployment(environ={}), robot=str(description.folder), ros=settings, cell="")
        twin = Twin(clock, description, deployment, folder)
        try:
            named = {"deployment": twin.deployment, "robot": description.name}
            operator = ServiceNode(node_name(deployment), bus=twin.bus(), stop=ShutdownRequest(), **named)
            try:
                run(operator, twin.deployment)
                node = Node("program", bus=twin.bus(), log_level="warning", **named)
                found = RosTwin(twin, operator, node, client)
                found.cut_router = routers.close
                with found.arm:
                    assert found.run_until(lambda: any("set_parameters_atomically" in each for each in client.tokens()))
                    yield found
            finally:
                operator.close()
        finally:
            twin.close()


def client_token(client: RosClient, number: int = 1) -> tuple[str, bytes]:
    """The token of a service client of ROS, and its GID."""
    session = str(client.session.info.zid())
    kind = ros_type(f"{FOLLOW}_SendGoal")
    node = NodeName("moveit")
    token = endpoint_token(node, session, number, EntityKind.CLIENT, f"{ACTION}/send_goal", kind, DEFAULT)
    return token, gid_of(token)


def uuid(number: int) -> bytes:
    """A goal's id."""
    return bytes(np.full(16, number, np.uint8))
