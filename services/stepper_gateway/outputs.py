"""The outputs of the core: frames to send, messages to publish, news of goals, answers, log lines."""

from __future__ import annotations

from typing import Any

import msgspec

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.control import ControlAnswer
from gemelo.schemas.device import ConfigureResponse, DeviceCommandResponse, EchoResponse, InjectResponse
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandResult
from gemelo.schemas.message import Message
from gemelo.schemas.motion import FollowJointTrajectoryFeedback, FollowJointTrajectoryResult
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import Topic
from gemelo.services.stepper_gateway.ledger.confidence import LedgerRecord
from gemelo.services.stepper_gateway.links.link import Kind

Response = DeviceCommandResponse | ConfigureResponse | InjectResponse | EchoResponse | ControlAnswer


class SendFrame(msgspec.Struct, frozen=True):
    """Bytes for the device, now or never."""

    kind: Kind
    payload: bytes
    urgent: bool = False  # before all that waits for the wire


class Publish(msgspec.Struct, frozen=True):
    """A message for the bus."""

    topic: Topic[Any]
    message: Message


class GoalExecuting(msgspec.Struct, frozen=True):
    """The device has taken the first knots of a goal."""

    goal_id: str


class GoalProgress(msgspec.Struct, frozen=True):
    """Feedback on a goal."""

    goal_id: str
    feedback: FollowJointTrajectoryFeedback


class GoalFinished(msgspec.Struct, frozen=True):
    """A goal's end."""

    goal_id: str
    status: GoalStatusCode
    result: FollowJointTrajectoryResult


class GripperExecuting(msgspec.Struct, frozen=True):
    """The device has taken a goal of the gripper."""

    goal_id: str


class GripperProgress(msgspec.Struct, frozen=True):
    """Feedback on a goal of the gripper."""

    goal_id: str
    feedback: GripperCommandFeedback


class GripperFinished(msgspec.Struct, frozen=True):
    """The end of a goal of the gripper."""

    goal_id: str
    status: GoalStatusCode
    result: GripperCommandResult


class Answer(msgspec.Struct, frozen=True):
    """The answer to whoever has asked under `ticket`."""

    ticket: int
    response: Response


class KeepLedger(msgspec.Struct, frozen=True):
    """The step ledger, to be kept over a restart."""

    record: LedgerRecord


class LogLine(msgspec.Struct, frozen=True):
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
