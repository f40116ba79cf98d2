"""Drives a gateway core without bus and process: gives it inputs, and keeps what it answers and publishes.

This file is the only one of the room that knows the gateway's modules.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

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
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.device.command_arguments import KINDS
from gemelo.services.stepper_gateway.goals.goal_executor import GoalVerdict
from gemelo.services.stepper_gateway.inputs import (
    CancelInput,
    CommandInput,
    ConfigureInput,
    EchoInput,
    FrameInput,
    GiveControlInput,
    GoalInput,
    GripCancelInput,
    GripInput,
    InjectInput,
    Input,
    JoinControlInput,
    LinkInput,
    NewcomerInput,
    PlannerInput,
    Reply,
    SceneInput,
    StepInput,
    StopInput,
    TakeControlInput,
    TargetsInput,
    VerdictInput,
    link_input,
)
from gemelo.services.stepper_gateway.ledger.confidence import LedgerRecord
from gemelo.services.stepper_gateway.links.link import Kind
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

__all__ = [
    "CancelInput", "ConfigureInput", "EchoInput", "FrameInput", "GatewayDriver", "GatewayParameters", "GripCancelInput",
    "InjectInput", "Kind", "LinkInput", "Moment", "NewcomerInput", "PlannerInput", "SceneInput", "StepInput",
    "TargetsInput", "VerdictInput", "asked", "link_input",
]  # fmt: skip

Ended = tuple[GoalStatusCode, FollowJointTrajectoryResult]


class GatewayDriver(ABC):
    """A gateway core and everything that it has said; a subclass has the clock, the wire and the device."""

    core: GatewayCore
    watches = False  # there is a planner that looks at the way of streamed targets

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
        parameters = replace(parameters or GatewayParameters(), watch_streams=self.watches)
        self.core = GatewayCore(arm, session_id, parameters, self.kept[-1] if self.kept else None)

    @property
    def reason_not_ready(self) -> str:
        """Reason for which the gateway accepts no goal now; empty if it does."""
        return str(self.core.not_ready(self.moment) or "")

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

    def handle(self, given: Input) -> Reply:
        """Gives the core one input now, and carries out what comes of it; returns what it says at once."""
        reply, outputs = self.core.handle(given, self.moment)
        self.carry_out(outputs)
        return reply

    def goal(
        self, goal: FollowJointTrajectoryGoal | JointTrajectory, goal_id: str = "g", session: str = ""
    ) -> GoalVerdict:
        """Asks the gateway to follow a trajectory; returns its acceptance or refusal."""
        if isinstance(goal, JointTrajectory):
            goal = FollowJointTrajectoryGoal(trajectory=goal)
        return self._verdict(GoalInput(goal_id, goal, session))

    def finish(self, goal_id: str = "g", seconds: float = 60.0) -> Ended:
        """Lets time pass until the goal has ended, at most `seconds` [s]; returns status and result."""
        assert self.run(seconds, lambda: goal_id in self.finished), f"{goal_id} has not ended"
        return self.finished[goal_id]

    def grip(self, position: float, max_effort: float = 0.0, goal_id: str = "grip", session: str = "") -> GoalVerdict:
        """Asks the gripper to open or close to `position` [m]; returns its acceptance or refusal."""
        return self._verdict(GripInput(goal_id, GripperCommandGoal(position=position, max_effort=max_effort), session))

    def _verdict(self, given: GoalInput | GripInput) -> GoalVerdict:
        verdict = self.handle(given)
        assert isinstance(verdict, GoalVerdict)
        return verdict

    def finish_grip(self, goal_id: str = "grip", seconds: float = 10.0) -> tuple[GoalStatusCode, GripperCommandResult]:
        """Lets up to `seconds` [s] pass until the gripper's goal has ended; its status and result, forgotten here."""
        assert self.run(seconds, lambda: goal_id in self.gripped), f"{goal_id} has not ended"
        return self.gripped.pop(goal_id)

    def target(self, **positions: float) -> None:
        """Streams a target [rad] or [m] for the joints named."""
        stamp, names = self.moment.unix, tuple(positions)
        self.handle(TargetsInput(JointTargets(stamp=stamp, name=names, position=tuple(positions.values()))))

    def command(self, kind: DeviceCommandKind, ticket: int = 1, **positions: float) -> None:
        """Asks for the command of that number, with positions [rad] or [m] of the joints named."""
        self.ask(asked(kind, name=tuple(positions), position=tuple(positions.values())), ticket)

    def ask(self, wanted: DeviceCommand | StopKind, ticket: int = 1, session: str = "") -> None:
        """Asks for a command or a stop; its answer comes in `answers`."""
        if isinstance(wanted, StopKind):
            self.handle(StopInput(ticket, DeviceStopRequest(kind=wanted)))
        else:
            self.handle(CommandInput(ticket, DeviceCommandRequest(command=wanted), session))

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
                self.handle(TakeControlInput(ticket, request, session))
            case ControlJoin():
                self.handle(JoinControlInput(ticket, request, session))
            case ControlGive():
                self.handle(GiveControlInput(ticket, request))

    def configure(self, seconds: float = 6.0) -> ConfigureResponse:
        """Sends the device its configuration; returns the answer, at most `seconds` [s] later."""
        self.handle(ConfigureInput(1))
        assert self.run(seconds, lambda: 1 in self.configured), "the configuration is not answered"
        self.run(0.1)
        return self.configured.pop(1)

    def receive(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        """Hands the gateway a payload as if it came over the wire."""
        self.handle(FrameInput(kind, payload, retained, round(self.moment.monotonic * 1e9)))

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
