"""Drives a gateway core without bus and process: asks it for things and keeps what it answers and publishes.

This file is the only one of the room that knows the gateway's modules.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.control import ControlAnswer, ControlGive, ControlJoin, ControlTake
from gemelo.schemas.device import (
    ConfigureResponse,
    DeviceCommand,
    DeviceCommandKind,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceState,
    DeviceStopRequest,
    EchoResponse,
    InjectRequest,
    InjectResponse,
    StopKind,
)
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Message
from gemelo.schemas.motion import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTrajectory,
)
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import Topic
from gemelo.services.stepper_gateway.control.clients import MotionCaller
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.device.command_arguments import KINDS
from gemelo.services.stepper_gateway.goals.goal_executor import GoalVerdict
from gemelo.services.stepper_gateway.ledger.record import LedgerRecord
from gemelo.services.stepper_gateway.links.link import Kind, Received
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import (
    Answer,
    GoalExecuting,
    GoalFinished,
    GoalProgress,
    GripperFinished,
    GripperProgress,
    KeepLedger,
    LogLine,
    Output,
    Publish,
    SendFrame,
)
from gemelo.services.stepper_gateway.parameters import GatewayParameters

__all__ = ["GatewayDriver", "GatewayParameters", "Kind", "Moment", "MotionCaller", "asked"]

Ended = tuple[GoalStatusCode, FollowJointTrajectoryResult]


class GatewayDriver(ABC):
    """A gateway core and everything that it has said; a subclass has the clock, the wire and the device."""

    core: GatewayCore

    def __init__(self, on_message: Callable[[Message], None] | None = None) -> None:
        """`on_message` receives the published messages; without it they are kept in `published`."""
        self.published: dict[str, list[Any]] = defaultdict(list)  # by key
        self.finished: dict[str, Ended] = {}  # by goal id
        self.gripped: dict[str, tuple[GoalStatusCode, GripperCommandResult]] = {}  # by goal id
        self.gripping: list[GripperCommandFeedback] = []
        self.executing: list[str] = []  # goal ids
        self.feedback: list[FollowJointTrajectoryFeedback] = []
        self.answers: dict[int, DeviceCommandResponse] = {}  # by ticket, like the next two
        self.configured: dict[int, ConfigureResponse] = {}
        self.pressed: dict[int, InjectResponse] = {}
        self.echoed: dict[int, EchoResponse] = {}
        self.controlled: dict[int, ControlAnswer] = {}  # by ticket
        self.absences: dict[str, float] = {}  # [s] of liveliness tokens, by key
        self.log: list[str] = []
        self.levels: list[LogLevel] = []  # of the lines of `log`
        self.kept: list[LedgerRecord] = []  # of the step ledger
        self._on_message = on_message

    @property
    @abstractmethod
    def moment(self) -> Moment:
        """The gateway's clocks now."""

    @abstractmethod
    def send(self, kind: Kind, payload: bytes) -> None:
        """Puts a frame of the gateway on the wire."""

    @abstractmethod
    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Lets `seconds` [s] pass; returns True as soon as `until` holds, or at the end if there is none."""

    def start_core(self, arm: ArmDescription, session_id: int, parameters: GatewayParameters | None = None) -> None:
        """The gateway's process starts, perhaps again, with the ledger that it kept last; its link is not up yet."""
        self.core = GatewayCore(arm, session_id, parameters, self.kept[-1] if self.kept else None)

    @property
    def reason_not_ready(self) -> str:
        """Reason for which the gateway accepts no goal now; empty if it does."""
        return self.core.not_ready(self.moment)

    @property
    def state(self) -> DeviceState:
        """The last `device/state`."""
        state: DeviceState = self.published["device/state"][-1]
        return state

    def messages(self, topic: Topic[Any]) -> list[Any]:
        """Everything published on `topic`, oldest first."""
        return self.published[topic.key]

    def events(self) -> list[str]:
        """Names of all device events, oldest first."""
        return [event.event for event in self.published["device/events"]]

    def goal(
        self,
        goal: FollowJointTrajectoryGoal | JointTrajectory,
        goal_id: str = "g",
        caller: MotionCaller = MotionCaller(),  # noqa: B008 a tuple of texts
    ) -> GoalVerdict:
        """Asks the gateway to follow a trajectory; returns its acceptance or refusal."""
        if isinstance(goal, JointTrajectory):
            goal = FollowJointTrajectoryGoal(trajectory=goal)
        verdict, outputs = self.core.on_goal(goal_id, goal, self.moment, caller)
        self.carry_out(outputs)
        return verdict

    def finish(self, goal_id: str = "g", seconds: float = 60.0) -> Ended:
        """Lets time pass until the goal has ended, at most `seconds` [s]; returns status and result."""
        assert self.run(seconds, lambda: goal_id in self.finished), f"{goal_id} has not ended"
        return self.finished[goal_id]

    def grip(
        self,
        position: float,
        max_effort: float = 0.0,
        goal_id: str = "grip",
        caller: MotionCaller = MotionCaller(),  # noqa: B008 a tuple of texts
    ) -> GoalVerdict:
        """Asks the gripper to open or close to `position` [m]; returns its acceptance or refusal."""
        goal = GripperCommandGoal(position=position, max_effort=max_effort)
        verdict, outputs = self.core.on_grip(goal_id, goal, self.moment, caller)
        self.carry_out(outputs)
        return verdict

    def finish_grip(self, goal_id: str = "grip", seconds: float = 10.0) -> tuple[GoalStatusCode, GripperCommandResult]:
        """Lets up to `seconds` [s] pass until the gripper's goal has ended; its status and result, forgotten here."""
        assert self.run(seconds, lambda: goal_id in self.gripped), f"{goal_id} has not ended"
        return self.gripped.pop(goal_id)

    def cancel_grip(self, goal_id: str = "grip") -> str:
        """Cancels the gripper's goal; returns the reason if that is refused, else an empty text."""
        reason, outputs = self.core.on_grip_cancel(goal_id, self.moment)
        self.carry_out(outputs)
        return reason

    def cancel(self, goal_id: str = "g") -> str:
        """Cancels the goal; returns the reason if that is refused, else an empty text."""
        reason, outputs = self.core.on_cancel(goal_id, self.moment)
        self.carry_out(outputs)
        return reason

    def target(self, **positions: float) -> None:
        """Streams a target [rad] or [m] for the joints named."""
        self.stream(JointTargets(name=tuple(positions), position=tuple(positions.values())))

    def stream(self, targets: JointTargets, node: str = "") -> None:
        """Hands the gateway one message of streamed targets of `node`."""
        self.carry_out(self.core.on_targets(targets, self.moment, MotionCaller(node=node)))

    def command(self, kind: DeviceCommandKind, ticket: int = 1, **positions: float) -> None:
        """Asks for the command of that number, with positions [rad] or [m] of the joints named."""
        self.ask(asked(kind, name=tuple(positions), position=tuple(positions.values())), ticket)

    def ask(self, wanted: DeviceCommand | StopKind, ticket: int = 1, session: str = "") -> None:
        """Asks for a command or a stop; its answer comes in `answers`."""
        if isinstance(wanted, StopKind):
            self.carry_out(self.core.on_stop(DeviceStopRequest(kind=wanted), ticket, self.moment))
        else:
            self.carry_out(
                self.core.on_command(DeviceCommandRequest(command=wanted), ticket, self.moment, MotionCaller(session))
            )

    def answer(self, wanted: DeviceCommand | StopKind, ticket: int = 1, seconds: float = 3.0) -> DeviceCommandResponse:
        """Asks for a command or a stop; returns its answer, at most `seconds` [s] later, after the next states."""
        self.ask(wanted, ticket)
        assert self.run(seconds, lambda: ticket in self.answers), f"{wanted} is not answered"
        self.run(0.1)
        return self.answers.pop(ticket)

    def control(self, request: ControlTake | ControlJoin | ControlGive, session: str, ticket: int = 1) -> None:
        """Asks for control, a share of it, or gives it back; the answer comes in `controlled`."""
        match request:
            case ControlTake():
                self.carry_out(self.core.on_take_control(request, session, ticket, self.moment))
            case ControlJoin():
                self.carry_out(self.core.on_join_control(request, session, ticket, self.moment))
            case ControlGive():
                self.carry_out(self.core.on_give_control(request, ticket, self.moment))

    def configure(self, seconds: float = 6.0) -> ConfigureResponse:
        """Sends the device its configuration; returns the answer, at most `seconds` [s] later."""
        self.ask_configuration(1)
        assert self.run(seconds, lambda: 1 in self.configured), "the configuration is not answered"
        self.run(0.1)
        return self.configured.pop(1)

    def ask_configuration(self, ticket: int) -> None:
        """Sends the device its configuration; the answer comes in `configured`."""
        self.carry_out(self.core.on_configure(ticket, self.moment))

    def press(self, request: InjectRequest, ticket: int = 1) -> None:
        """Does something to the virtual device's world; the answer comes in `pressed`."""
        self.carry_out(self.core.on_inject(request, ticket, self.moment))

    def receive(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        """Hands the gateway a payload as if it came over the wire."""
        received = Received(kind, payload, retained, round(self.moment.monotonic * 1e9))
        self.carry_out(self.core.on_received(received, self.moment))

    def carry_out(self, outputs: list[Output]) -> None:
        """Sends the frames, and keeps everything else."""
        for output in outputs:
            match output:
                case SendFrame(kind, payload):
                    self.send(kind, payload)
                case Publish(topic, message):
                    (self._on_message or self.published[topic.key].append)(message)
                case GoalExecuting(goal_id):
                    self.executing.append(goal_id)
                case GoalProgress(_, feedback):
                    self.feedback.append(feedback)
                case GoalFinished(goal_id, status, result):
                    assert goal_id not in self.finished, f"{goal_id} ends twice"
                    self.finished[goal_id] = (status, result)
                case GripperProgress(_, told):
                    self.gripping.append(told)
                case GripperFinished(goal_id, status, outcome):
                    assert goal_id not in self.gripped, f"{goal_id} ends twice"
                    self.gripped[goal_id] = (status, outcome)
                case Answer(ticket, DeviceCommandResponse() as response):
                    self.answers[ticket] = response
                case Answer(ticket, ConfigureResponse() as response):
                    self.configured[ticket] = response
                case Answer(ticket, InjectResponse() as response):
                    self.pressed[ticket] = response
                case Answer(ticket, EchoResponse() as response):
                    self.echoed[ticket] = response
                case Answer(ticket, ControlAnswer() as response):
                    self.controlled[ticket] = response
                case KeepLedger(record):
                    self.kept.append(record)
                case LogLine(level, text):
                    self.log.append(text)
                    self.levels.append(level)


def asked(kind: DeviceCommandKind, **fields: Any) -> DeviceCommand | StopKind:
    """The command or stop of that number on the wire, with those of `fields` that it has."""
    if kind in (DeviceCommandKind.STOP, DeviceCommandKind.HOLD, DeviceCommandKind.DISARM):
        return StopKind[kind.name]
    command = next(command for command, number in KINDS.items() if number == kind)
    return command(**{field: value for field, value in fields.items() if field in command.__struct_fields__})
