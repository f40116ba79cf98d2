"""Jogging on a bus: targets while commands come, none without, and plans beside it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand, NamedGoal, PlanCode, PlanRequest, PlanResponse
from gemelo.schemas.topics import JOG, JOG_STATUS, JOINT_STATES, JOINT_TARGETS, PLAN
from tests.planner.planning_node import beside_a_planner

TURN = JogCommand(name=("brazo_joint",), velocity=(0.3,))
PATIENCE = 60.0  # [s]


class Follower:
    """A node that does at once what the targets say."""

    def __init__(self, node: Node, arm: ArmDescription) -> None:
        self.node, self.arm = node, arm
        self.states = node.publisher(JOINT_STATES)
        self.targets = node.latest(JOINT_TARGETS)
        self.status = node.latest(JOG_STATUS)
        self.jog = node.publisher(JOG)

    def until(self, is_done: Callable[[], bool], command: JogCommand | None = None) -> None:
        end = self.node.monotonic() + PATIENCE
        while not is_done():
            assert self.node.monotonic() < end
            target = self.targets.message
            position = target.position if target is not None else (0.0,) * len(self.arm.joints)
            self.states.put(JointState(stamp=self.node.now(), name=self.arm.joint_names, position=position))
            if command is not None:
                self.jog.put(command)
            self.node.wait(0.02)


@pytest.fixture
def follower(tmp_path: Path, rm1: ArmDescription) -> Iterator[Follower]:
    with beside_a_planner(tmp_path, "follower", ends_within=10.0) as node:
        yield Follower(node, rm1)


def test_commands_lead_the_arm_and_silence_ends_it(follower: Follower):
    follower.until(lambda: follower.targets.message is not None and follower.targets.message.position[0] > 0.2, TURN)
    assert follower.status.message is not None
    assert follower.status.message.active
    follower.until(lambda: not follower.status.message.active)
    stood = follower.targets.message.position
    assert stood[1:] == (0.0, 0.0)
    beyond = follower.node.monotonic() + 0.3
    follower.until(lambda: follower.node.monotonic() > beyond)
    assert follower.targets.message.position == stood


def test_a_plan_is_answered_after_jogging(follower: Follower):
    follower.until(lambda: follower.targets.message is not None and follower.targets.message.position[0] > 0.05, TURN)
    follower.until(lambda: not follower.status.message.active)
    responses: list[PlanResponse] = []
    request = PlanRequest(goal=NamedGoal(name="home"), allowed_time=5.0)
    asking = threading.Thread(target=lambda: responses.append(follower.node.call(PLAN, request, timeout=PATIENCE)))
    asking.start()
    follower.until(lambda: bool(responses))
    asking.join()
    assert responses[0].code is PlanCode.SUCCESS
