"""The gateway's core on a real wire in real time."""

from __future__ import annotations

import os
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any, TypeVar

from schemas.actions import GoalStatusCode
from schemas.device import (
    ConfigureResponse,
    DeviceCommand,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceState,
    DeviceStopRequest,
    PressRequest,
    PressResponse,
    StopKind,
)
from schemas.motion import FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from services.stepper_gateway.core import GatewayCore
from services.stepper_gateway.links.link import Link
from services.stepper_gateway.links.mqtt import MqttLink
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.outputs import Answer, GoalFinished, Output, Publish, Response, SendFrame
from tests.stepper_gateway.harness import move, rm1

R = TypeVar("R", DeviceCommandResponse, ConfigureResponse, PressResponse)


class Gateway:
    """Core and link with a small loop of their own, without the bus."""

    def __init__(self, port: int, link: Callable[[Callable[[], None]], Link] | None = None) -> None:
        self.core = GatewayCore(rm1(), int.from_bytes(os.urandom(3), "little") + 1)
        self.published: dict[str, list[Any]] = defaultdict(list)
        self.finished: dict[str, tuple[GoalStatusCode, FollowJointTrajectoryResult]] = {}
        self._woken = threading.Event()
        self._answers: dict[int, Response] = {}
        self.link = link(self._woken.set) if link else MqttLink("127.0.0.1", port, "rm1", self._woken.set)

    def close(self) -> None:
        self.link.close()

    @property
    def moment(self) -> Moment:
        return Moment(time.time_ns(), time.monotonic())

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        end = time.monotonic() + seconds
        due = 0.0
        while time.monotonic() < end:
            if until():
                return True
            if time.monotonic() >= due:
                due = time.monotonic() + 0.02
                self.do(self.core.step(self.moment))
            self._woken.wait(max(0.0, due - time.monotonic()))
            self._woken.clear()
            self.do(self.core.on_link(self.link.connected, self.link.reason, self.moment))
            for received in self.link.take(64):
                self.do(self.core.on_received(received, self.moment))
        return until()

    def ready(self) -> None:
        assert self.run(15.0, lambda: not self.core.not_ready(self.moment)), self.core.not_ready(self.moment)
        self.run(0.1)

    def goal(self, end: tuple[float, ...], goal_id: str = "g") -> Any:
        here = self.published["joint_states"][-1].position
        verdict, outputs = self.core.on_goal(
            goal_id, FollowJointTrajectoryGoal(trajectory=move(here, end)), self.moment
        )
        self.do(outputs)
        return verdict

    def finish(self, goal_id: str = "g") -> tuple[GoalStatusCode, FollowJointTrajectoryResult]:
        assert self.run(20.0, lambda: goal_id in self.finished)
        return self.finished[goal_id]

    def do(self, outputs: list[Output]) -> None:
        for output in outputs:
            match output:
                case SendFrame(kind, payload):
                    self.link.send(kind, payload)
                case Publish(topic, message):
                    self.published[topic.key].append(message)
                case GoalFinished(goal_id, status, result):
                    self.finished[goal_id] = (status, result)
                case Answer(ticket, response):
                    self._answers[ticket] = response
                case _:
                    pass

    @property
    def state(self) -> DeviceState:
        """What was last said of the device."""
        state: DeviceState = self.published["device/state"][-1]
        return state

    def press(self, request: PressRequest) -> PressResponse:
        """The answer of the virtual device."""
        self.do(self.core.on_press(request, 1, self.moment))
        return self._answer(PressResponse)

    def command(self, wanted: DeviceCommand | StopKind) -> DeviceCommandResponse:
        """The answer of the device."""
        if isinstance(wanted, StopKind):
            self.do(self.core.on_stop(DeviceStopRequest(kind=wanted), 1, self.moment))
        else:
            self.do(self.core.on_command(DeviceCommandRequest(command=wanted), 1, self.moment))
        return self._answer(DeviceCommandResponse)

    def configure(self) -> ConfigureResponse:
        """The answer of the device."""
        self.do(self.core.on_configure(1, self.moment))
        return self._answer(ConfigureResponse)

    def _answer(self, kind: type[R]) -> R:
        assert self.run(8.0, lambda: 1 in self._answers)
        answer = self._answers.pop(1)
        assert isinstance(answer, kind)
        return answer
