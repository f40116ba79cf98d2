"""Joins the core to the node and the link: carries things in and out, decides nothing."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from schemas.device import (
    ConfigureRequest,
    ConfigureResponse,
    DeviceCommandRequest,
    DeviceCommandResponse,
    PressRequest,
    PressResponse,
)
from schemas.joints import JointTargets
from schemas.motion import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
)
from schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_CONFIGURE,
    DEVICE_PRESS,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_TARGETS,
    SCENE,
)
from services.runtime.action_server import ActionServer, GoalDecision, accept, refuse
from services.runtime.errors import Refused
from services.runtime.node import Node
from services.runtime.parameters import ParameterSet
from services.stepper_gateway.core import GatewayCore
from services.stepper_gateway.links.link import Link
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.outputs import (
    Answer,
    GoalExecuting,
    GoalFinished,
    GoalProgress,
    LogLine,
    Output,
    Publish,
    Response,
    SendFrame,
)
from services.stepper_gateway.parameters import GatewayParameters

AT_ONCE = 64  # payloads handled before the loop may look at its deadline
PATIENCE = 12.0  # [s] a caller waits; the core answers sooner

R = TypeVar("R", DeviceCommandResponse, ConfigureResponse, PressResponse)
Server = ActionServer[FollowJointTrajectoryGoal, FollowJointTrajectoryFeedback, FollowJointTrajectoryResult]


@dataclass
class Ticket:
    """A caller in the node's worker thread who waits for the device's answer."""

    response: Response | None = None
    answered: threading.Event = field(default_factory=threading.Event)


class Shell:
    """Everything here runs in the thread of logic, but `wake` and the waiting of callers for their answers."""

    def __init__(self, node: Node, core: GatewayCore, parameters: ParameterSet[GatewayParameters]) -> None:
        self._node, self._core, self._parameters = node, core, parameters
        self._link: Link | None = None
        self._is_woken = threading.Event()
        self._tickets: dict[int, Ticket] = {}
        self._numbers = itertools.count(1)
        self._server: Server = node.serve_action(FOLLOW_JOINT_TRAJECTORY, self._on_goal, self._on_cancel)
        node.subscribe(JOINT_TARGETS, self._on_targets)
        node.subscribe(SCENE, core.on_scene)
        node.serve(DEVICE_COMMAND, self._on_command, worker=True)
        node.serve(DEVICE_CONFIGURE, self._on_configure, worker=True)
        node.serve(DEVICE_PRESS, self._on_press, worker=True)

    def use(self, link: Link) -> None:
        self._link = link
        self.wake()

    def wake(self) -> None:
        """Something has happened on the link; from any thread."""
        if not self._is_woken.is_set():
            self._is_woken.set()
            self._node.post(self._on_link)

    def step(self, _now: int) -> None:
        """One turn of the control loop."""
        self._core.set_parameters(self._parameters.value)
        self._carry_out(self._core.step(self._moment()))
        reason = self._core.not_ready(self._moment())
        self._node.set_ready(not reason, reason)

    def _moment(self) -> Moment:
        return Moment(self._node.now(), self._node.monotonic())

    def _on_link(self) -> None:
        self._is_woken.clear()
        link = self._link
        if link is None:
            return
        self._carry_out(self._core.on_link(link.connected, link.reason, self._moment()))
        received = link.take(AT_ONCE)
        for payload in received:
            self._carry_out(self._core.on_received(payload, self._moment()))
        if len(received) == AT_ONCE:
            self.wake()

    def _on_goal(self, goal_id: str, goal: FollowJointTrajectoryGoal) -> GoalDecision:
        verdict, outputs = self._core.on_goal(goal_id, goal, self._moment())
        self._carry_out(outputs)
        return accept() if verdict.accepted else refuse(verdict.code, verdict.reason)

    def _on_cancel(self, goal_id: str) -> str:
        reason, outputs = self._core.on_cancel(goal_id, self._moment())
        self._carry_out(outputs)
        return reason

    def _on_targets(self, targets: JointTargets) -> None:
        self._carry_out(self._core.on_targets(targets, self._moment()))

    def _on_command(self, request: DeviceCommandRequest) -> DeviceCommandResponse:
        return self._wait(DeviceCommandResponse, lambda number, now: self._core.on_command(request, number, now))

    def _on_configure(self, _request: ConfigureRequest) -> ConfigureResponse:
        return self._wait(ConfigureResponse, lambda number, now: self._core.on_configure(number, now))

    def _on_press(self, request: PressRequest) -> PressResponse:
        return self._wait(PressResponse, lambda number, now: self._core.on_press(request, number, now))

    def _wait(self, kind: type[R], ask: Callable[[int, Moment], list[Output]]) -> R:
        """In the worker thread: hands the request over and waits for the device's answer."""
        number, ticket = next(self._numbers), Ticket()
        self._tickets[number] = ticket
        self._node.post(lambda: self._carry_out(ask(number, self._moment())))
        ticket.answered.wait(PATIENCE)
        self._tickets.pop(number, None)
        if not isinstance(ticket.response, kind):
            raise Refused("the gateway's control loop has not answered in time")
        return ticket.response

    def _carry_out(self, outputs: list[Output]) -> None:
        for output in outputs:
            match output:
                case SendFrame(kind, payload):
                    if self._link is not None:
                        self._link.send(kind, payload)
                case Publish(topic, message):
                    self._node.publisher(topic).put(message)
                case GoalExecuting(goal_id):
                    self._server.executing(goal_id)
                case GoalProgress(goal_id, feedback):
                    self._server.feedback(goal_id, feedback)
                case GoalFinished(goal_id, status, result):
                    self._server.finish(goal_id, status, result)
                case Answer(number, response):
                    self._answer(number, response)
                case LogLine(level, text):
                    self._node.log.log(level, "%s", text)

    def _answer(self, number: int, response: Response) -> None:
        ticket = self._tickets.get(number)
        if ticket is not None:
            ticket.response = response
            ticket.answered.set()
