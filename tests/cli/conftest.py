"""A planner and a gateway on a bus in memory, for the commands that speak with them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.api.session import Session as ArmSession
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.actions.server import accept, refuse
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.device import (
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceMode,
    DeviceState,
    DeviceStatus,
    DeviceStopRequest,
)
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
)
from gemelo.schemas.plain_text import ENGLISH
from gemelo.schemas.planning import PlanRequest, PlanResponse
from gemelo.schemas.reasons import plain
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_STATE,
    DEVICE_STATUS,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_STATES,
    PLAN,
    STEP_ERRORS,
)
from gemelo.services.planner.core import Planner
from gemelo.tools.cli.common import language
from gemelo.tools.cli.common.session import CommandSession
from tests.runtime.support import RouterProcess, spinning

MOVE_TIME = 0.4  # [s] that every goal takes here


class PretendGateway:
    """Accepts goals, and ends each after a while as it was told to."""

    def __init__(self, node: Node, arm: ArmDescription) -> None:
        self.ends_as = GoalStatusCode.SUCCEEDED
        self.reason = ""
        self.refusal = ""
        self.goals: list[FollowJointTrajectoryGoal] = []
        self.commands: list[DeviceCommandRequest | DeviceStopRequest] = []
        self.mode = DeviceMode.IDLE
        self.command_refusal = plain("the arm moves")  # in Run
        self._node, self._arm = node, arm
        self._goal: tuple[str, float] | None = None
        self._server = node.serve_action(FOLLOW_JOINT_TRAJECTORY, self._on_goal, self._on_cancel)
        node.serve(DEVICE_COMMAND, self._on_command)
        node.serve(DEVICE_STOP, self._on_command)
        self._states, self._errors = node.publisher(JOINT_STATES), node.publisher(STEP_ERRORS)
        self._device = node.publisher(DEVICE_STATE)
        node.publisher(DEVICE_STATUS).put(DeviceStatus(online=True, device="rm1"))

    def step(self, now: int) -> None:
        names = self._arm.joint_names
        self._states.put(JointState(stamp=now, name=names, position=(0.5, 0.25, 0.04), velocity=(0.0, 0.0, 0.0)))
        self._errors.put(StepErrors(stamp=now, name=names, commanded=(1.5, 2.0, 3.0), executed=(1, 2, 3),
                                    error=(0.5, 0.0, 0.0)))  # fmt: skip
        self._device.put(DeviceState(stamp=now, mode=self.mode, time_scale=1.0, round_trip=0.002))
        if self._goal is not None:
            goal_id, started = self._goal
            elapsed = self._node.monotonic() - started
            self._server.feedback(goal_id, FollowJointTrajectoryFeedback(elapsed=elapsed, duration=MOVE_TIME))
            if elapsed > MOVE_TIME:
                self._finish(self.ends_as, self.reason)

    def _on_goal(self, goal_id: str, goal: FollowJointTrajectoryGoal):
        self.goals.append(goal)
        if self.refusal:
            return refuse(FollowErrorCode.INVALID_GOAL, self.refusal)
        self._goal = (goal_id, self._node.monotonic())
        return accept()

    def _on_cancel(self, goal_id: str) -> None:
        self._finish(GoalStatusCode.CANCELED, "cancelled")

    def _finish(self, status: GoalStatusCode, reason: str) -> None:
        assert self._goal is not None
        goal_id, self._goal = self._goal[0], None
        result = FollowJointTrajectoryResult(
            error_string=reason, joint_names=self._arm.joint_names, executed_steps=(933, -50, 113),
            final_error=(0.25, -0.5, 0.0), max_following_error=(0.5, 0.5, 0.5), duration=MOVE_TIME,
        )  # fmt: skip
        self._server.finish(goal_id, status, result)

    def _on_command(self, request: DeviceCommandRequest | DeviceStopRequest) -> DeviceCommandResponse:
        self.commands.append(request)
        if self.mode is DeviceMode.RUN:
            return DeviceCommandResponse(
                accepted=False, reason=str(self.command_refusal), mode=self.mode, why=self.command_refusal
            )
        return DeviceCommandResponse(accepted=True, mode=self.mode)


@pytest.fixture(autouse=True)
def english_again() -> Iterator[None]:
    """The language that a command line of this process has chosen ends with its test."""
    yield
    language.choose(ENGLISH)


@pytest.fixture(scope="session")
def arm() -> ArmDescription:
    return load_arm(Path(__file__).parents[2] / "urdf/rm1")


@pytest.fixture
def network() -> MemoryNetwork:
    return MemoryNetwork()


@pytest.fixture
def deployment(tmp_path: Path) -> Deployment:
    return Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out")))


@pytest.fixture
def gateway(arm: ArmDescription, network: MemoryNetwork, deployment: Deployment) -> Iterator[PretendGateway]:
    with Node("stepper_gateway", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        made = PretendGateway(node, arm)
        with spinning(node, made.step):
            yield made


@pytest.fixture
def planner(arm: ArmDescription, network: MemoryNetwork, deployment: Deployment) -> Iterator[None]:
    core = Planner(arm)
    home = JointState(name=arm.joint_names, position=(0.0,) * len(arm.joints))
    core.plan(PlanRequest(), home)  # the first one loads libraries, which may take longer than a caller waits

    def plan(request: PlanRequest) -> PlanResponse:
        return core.plan(request, home)

    with Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.serve(PLAN, plan)
        with spinning(node, rate=10.0):
            yield


@pytest.fixture
def session(arm: ArmDescription, network: MemoryNetwork, deployment: Deployment) -> Iterator[CommandSession]:
    with Node("cli-1", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        yield CommandSession(deployment, arm, node)


@pytest.fixture
def connected(arm: ArmDescription, network: MemoryNetwork, deployment: Deployment) -> Iterator[gemelo.Arm]:
    """The arm as the commands have it."""
    node = Node("cli-2", deployment, robot="rm1", bus=MemoryBus(network), log_level="warning")
    with gemelo.Arm(ArmSession(deployment, arm, node)) as made:
        yield made


@pytest.fixture
def router(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RouterProcess]:
    """A real router, which commands and nodes of this process find."""
    made = RouterProcess(tmp_path)
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(made.port))
    monkeypatch.setenv("GEMELO_PATHS_RUN", str(tmp_path / "run"))
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path / "out"))
    monkeypatch.delenv("GEMELO_ROBOT", raising=False)
    yield made
    made.stop()
