"""A goal that is read in pieces holds up nothing, keeps its place before later ones, and is void after a stop."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field

import msgspec
import pytest

from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.actions.coming_goals import MOST_BYTES
from gemelo.libraries.runtime.actions.server import GoalDecision, accept
from gemelo.libraries.runtime.bus.interface import Bus, BusReply
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.actions import CancelRequest, GoalRequest
from gemelo.schemas.device import DeviceCommandResponse, DeviceStopRequest
from gemelo.schemas.message import BadMessage, decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW
from tests.runtime.support import Buses, spinning, until

GOAL, CANCEL = keys.goal_request(FOLLOW).key, keys.cancel_request(FOLLOW).key
LONG, BAD = ("long",), ("bad",)  # names of joints of goals that are read in pieces


@dataclass
class Reader:
    """A node whose long goals are read as far as a test lets them."""

    node: Node
    is_held: bool = True
    pieces: int = 0
    steps: int = 0
    begun: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.action = self.node.serve_action(FOLLOW, self.on_goal, lambda goal_id: None, self.read)
        self.node.serve_later(DEVICE_STOP, self.on_stop)

    def read(self, payload: bytes) -> Generator[None, None, FollowJointTrajectoryGoal]:
        goal = decode(FollowJointTrajectoryGoal, payload)
        while self.is_held and goal.trajectory.joint_names in (LONG, BAD):
            self.pieces += 1
            yield
        if goal.trajectory.joint_names == BAD:
            raise BadMessage("oh")
        return goal

    def on_goal(self, goal_id: str, goal: FollowJointTrajectoryGoal) -> GoalDecision:
        self.begun.append(goal_id)
        return accept()

    def on_stop(self, _request: DeviceStopRequest, pending: Pending[DeviceCommandResponse]) -> None:
        self.action.refuse_waiting(because("command.overtaken", stop="stop"), pending.asked)
        pending.reply(DeviceCommandResponse(accepted=True))

    def step(self, _now: int) -> None:
        self.steps += 1


def send(client: Bus, reader: Reader, goal_id: str, names: tuple[str, ...]) -> list[BusReply | None]:
    """The answer, once it is there."""
    answers: list[BusReply | None] = []
    goal = encode(FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=names)))
    request = GoalRequest(goal_id=goal_id, client="test", goal=msgspec.Raw(goal), epoch=reader.action.epoch)
    client.ask(GOAL, "GoalRequest", encode(request), 20.0, answers.append)
    return answers


@pytest.fixture
def reader(buses: Buses) -> Reader:
    return Reader(buses.node("gateway"))


def test_the_loop_goes_on_between_the_pieces_and_a_later_goal_keeps_its_place(buses: Buses, reader: Reader) -> None:
    client = buses.open()
    with spinning(reader.node, reader.step, rate=200.0):
        assert client.wait_served(GOAL, 5.0)
        first, second = send(client, reader, "first", LONG), send(client, reader, "second", ())
        assert until(lambda: reader.pieces > 10)
        steps = reader.steps
        assert until(lambda: reader.steps > steps + 10)
        assert (first, second, reader.begun) == ([], [], [])
        reader.is_held = False
        assert until(lambda: bool(first and second))
    assert reader.begun == ["first", "second"]


def test_a_stop_refuses_a_goal_that_is_being_read_and_those_behind_it(buses: Buses, reader: Reader) -> None:
    client = buses.open()
    stopped: list[BusReply | None] = []
    with spinning(reader.node, reader.step, rate=200.0):
        assert client.wait_served(GOAL, 5.0)
        assert client.wait_served(DEVICE_STOP.key, 5.0)
        answers = send(client, reader, "first", LONG), send(client, reader, "second", ())
        assert until(lambda: reader.pieces > 0)
        client.ask(DEVICE_STOP.key, "DeviceStopRequest", encode(DeviceStopRequest()), 20.0, stopped.append)
        assert until(lambda: bool(stopped) and all(answers))
        for (answer,) in answers:
            assert answer is not None
            assert b"stop was asked for after it: ask again" in answer.payload
        reader.is_held = False
        last = send(client, reader, "last", LONG)
        assert until(lambda: bool(last))
    assert reader.begun == ["last"]


def test_a_cancel_refuses_a_goal_that_is_being_read_however_long_that_takes(buses: Buses, reader: Reader) -> None:
    client = buses.open()
    canceled: list[BusReply | None] = []
    with spinning(reader.node, reader.step, rate=200.0):
        assert client.wait_served(GOAL, 5.0)
        assert client.wait_served(CANCEL, 5.0)
        first, second = send(client, reader, "first", LONG), send(client, reader, "second", LONG)
        assert until(lambda: reader.pieces > 0)
        client.ask(CANCEL, "CancelRequest", encode(CancelRequest(goal_id="first")), 20.0, canceled.append)
        assert until(lambda: bool(canceled and first))
        assert canceled[0] is not None
        assert b"is refused" in canceled[0].payload
        assert first[0] is not None
        assert b"it was cancelled before it was looked at" in first[0].payload
        reader.is_held = False
        assert until(lambda: bool(second))
    assert reader.begun == ["second"]


def test_what_fails_in_a_late_piece_is_a_refusal_and_the_next_goal_is_looked_at(buses: Buses, reader: Reader) -> None:
    client = buses.open()
    with spinning(reader.node, reader.step, rate=200.0):
        assert client.wait_served(GOAL, 5.0)
        first, second = send(client, reader, "first", BAD), send(client, reader, "second", ())
        assert until(lambda: reader.pieces > 0)
        reader.is_held = False
        assert until(lambda: bool(first and second))
    assert first[0] is not None
    assert b"oh" in first[0].payload
    assert reader.begun == ["second"]


def test_more_bytes_than_may_wait_behind_a_long_goal_are_refused_with_the_limit(
    buses: Buses, reader: Reader, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST_BYTES > 1000
    monkeypatch.setattr("gemelo.libraries.runtime.actions.coming_goals.MOST_BYTES", 1000)
    client, node = buses.open(), buses.node("client")
    with spinning(reader.node, reader.step, rate=200.0):
        assert client.wait_served(GOAL, 5.0)
        first = send(client, reader, "first", LONG)
        assert until(lambda: reader.pieces > 0)
        large = FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=("x" * 1000,)))
        with pytest.raises(RequestRefused, match=r"\d+ bytes of goals are looked at already, at most 1000: ask again"):
            node.action(FOLLOW).send(large)
        reader.is_held = False
        assert until(lambda: bool(first))
    assert reader.begun == ["first"]
