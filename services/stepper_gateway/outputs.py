"""The outputs of the core: frames to send, messages to publish, news of goals, answers, log lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from schemas.actions import GoalStatusCode
from schemas.control import ControlAnswer
from schemas.device import ConfigureResponse, DeviceCommandResponse, EchoResponse, InjectResponse
from schemas.gripper import GripperCommandFeedback, GripperCommandResult
from schemas.message import Message
from schemas.motion import FollowJointTrajectoryFeedback, FollowJointTrajectoryResult
from schemas.system import LogLevel
from schemas.topics import Topic
from services.stepper_gateway.ledger.record import LedgerRecord
from services.stepper_gateway.links.link import Kind

Response = DeviceCommandResponse | ConfigureResponse | InjectResponse | EchoResponse | ControlAnswer


@dataclass(frozen=True, slots=True)
class SendFrame:
    """Bytes for the device, now or never."""

    kind: Kind
    payload: bytes
    urgent: bool = False  # before all that waits for the wire


@dataclass(frozen=True, slots=True)
class Publish:
    """A message for the bus."""

    topic: Topic[Any]
    message: Message


@dataclass(frozen=True, slots=True)
class GoalExecuting:
    """The device has taken the first knots of a goal."""

    goal_id: str


@dataclass(frozen=True, slots=True)
class GoalProgress:
    """Feedback on a goal."""

    goal_id: str
    feedback: FollowJointTrajectoryFeedback


@dataclass(frozen=True, slots=True)
class GoalFinished:
    """A goal's end."""

    goal_id: str
    status: GoalStatusCode
    result: FollowJointTrajectoryResult


@dataclass(frozen=True, slots=True)
class GripperExecuting:
    """The device has taken a goal of the gripper."""

    goal_id: str


@dataclass(frozen=True, slots=True)
class GripperProgress:
    """Feedback on a goal of the gripper."""

    goal_id: str
    feedback: GripperCommandFeedback


@dataclass(frozen=True, slots=True)
class GripperFinished:
    """The end of a goal of the gripper."""

    goal_id: str
    status: GoalStatusCode
    result: GripperCommandResult


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to whoever has asked under `ticket`."""

    ticket: int
    response: Response


@dataclass(frozen=True, slots=True)
class KeepLedger:
    """The step ledger, to be kept over a restart."""

    record: LedgerRecord


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line for people."""

    level: LogLevel
    text: str


Output = (
    SendFrame
    | Publish
    | GoalExecuting
    | GoalProgress
    | GoalFinished
    | GripperExecuting
    | GripperProgress
    | GripperFinished
    | Answer
    | KeepLedger
    | LogLine
)


class Outbox:
    """Collects outputs in order until the shell takes them."""

    def __init__(self) -> None:
        self._items: list[Output] = []

    def put(self, item: Output) -> None:
        self._items.append(item)

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> None:
        self._items.append(SendFrame(kind, payload, urgent))

    def publish(self, topic: Topic[Any], message: Message) -> None:
        self._items.append(Publish(topic, message))

    def log(self, level: LogLevel, text: str) -> None:
        self._items.append(LogLine(level, text))

    def take(self) -> list[Output]:
        items, self._items = self._items, []
        return items
