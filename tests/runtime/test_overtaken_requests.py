"""A goal that was asked for before a stop is not carried out after it, however late it arrives."""

from __future__ import annotations

import threading

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.actions.server import accept
from gemelo.libraries.runtime.bus.interface import Bus, BusReply
from gemelo.libraries.runtime.bus.zenoh_declarations import CLIENT_BYTES, MAX_SECRET, asked_by, asker
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.limits import RequestRates
from gemelo.libraries.runtime.requests.overtaken import MOST_CLIENTS, MOST_JUMP, OvertakenRequests
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.actions import GoalRequest, GoalResponse
from gemelo.schemas.device import DeviceCommandResponse, DeviceStopRequest
from gemelo.schemas.message import decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.reasons import because
from gemelo.schemas.system import Failure, TopicStatistics
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW
from tests.runtime.support import Buses, spinning, until

GOAL = keys.goal_request(FOLLOW).key
NO_GOAL = msgspec.Raw(encode(FollowJointTrajectoryGoal()))
numbers = st.integers(1, MOST_JUMP)


@given(st.lists(numbers, min_size=1), numbers)
def test_what_a_client_asked_before_its_newest_stop_is_void_and_nothing_else(stops: list[int], number: int) -> None:
    requests = OvertakenRequests("goal")
    for at, stop in enumerate(stops):
        requests.stop(because("command.overtaken", stop="stop"), {"a": stop}, float(at))
    arrived = float(len(stops))
    refusal = requests.refusal("a", number, arrived)
    assert bool(refusal) == (number < max(stops))
    if refusal is not None:
        overtaken = because("command.overtaken", stop="stop")
        void = because("request.void.overtaken", overtaken, request="goal", number=number, stop=max(stops))
        assert refusal == void
    assert not requests.refusal("another", number, arrived)
    assert not requests.refusal("a", 0, arrived)
    assert requests.refusal("another", number, arrived - 1.0)


def test_the_newest_stop_of_the_last_clients_is_kept() -> None:
    requests = OvertakenRequests("goal")
    for name in range(10 * MOST_CLIENTS):
        requests.stop(because("command.overtaken", stop="stop"), {"operator": 10, f"client {name}": 10}, 0.0)
    assert requests.refusal("operator", 9, 1.0)
    assert requests.refusal(f"client {10 * MOST_CLIENTS - 1}", 9, 1.0)
    assert not requests.refusal("client 0", 9, 1.0)
    kept = sum(bool(requests.refusal(f"client {name}", 9, 1.0)) for name in range(10 * MOST_CLIENTS))
    assert kept + 1 == MOST_CLIENTS  # with the operator


@given(st.integers(MOST_JUMP + 1, 10**18 - 1), st.integers(1, 1000))
def test_a_number_far_above_all_before_refuses_nothing_for_good(number: int, own: int) -> None:
    requests = OvertakenRequests("goal")
    assert not requests.refusal("a", own, 0.0)
    requests.stop(because("command.overtaken", stop="stop"), {"a": own + number}, 1.0)
    assert requests.refusal("a", own + 1, 0.5)  # it had arrived by then
    assert not requests.refusal("a", own + 1, 2.0)
    requests.stop(because("command.overtaken", stop="stop"), {"a": own + 3}, 3.0)
    assert requests.refusal("a", own + 2, 4.0)


SECRETS = st.text("0123456789abcdef", min_size=1, max_size=MAX_SECRET)


@given(SECRETS, SECRETS, st.integers(0, 10**18 - 1))
def test_a_client_is_named_by_its_secret_and_certificate_together_and_neither_can_be_read_in_its_name(
    secret: str, other: str, number: int
) -> None:
    client, said = asker(asked_by(secret, number), "operator.desk")
    assert said == number
    assert asker(asked_by(secret, 1), "operator.desk")[0] == client
    assert asker(asked_by(secret, 1), "viewer.desk")[0] != client
    assert (asker(asked_by(other, 1), "operator.desk")[0] == client) == (other == secret)
    assert asker(asked_by(client, 1), "operator.desk")[0] != client  # what is published of it is of no use


@given(st.binary(max_size=200))
def test_what_others_attach_is_a_short_name_and_some_number(attached: bytes) -> None:
    name, number = asker(attached, "viewer")
    assert len(name) in (0, 2 * CLIENT_BYTES)
    assert number >= 0


class SoMany(RequestRates):
    """Permits as many requests as are left, of whomever."""

    left = 1000

    def permit_request(self, principal: str, client: str, urgent: bool = False) -> bool:
        """Urgent ones are counted with the others."""
        self.left -= 1
        return self.left >= 0


def gateway(buses: Buses, started: list[str], rates: RequestRates | None = None) -> tuple[Node, int]:
    """A node that refuses what a stop has overtaken, as stepper_gateway does, and the epoch of its goals."""
    node = buses.node("gateway", rates=rates)
    action = node.serve_action(FOLLOW, lambda goal_id, goal: started.append(goal_id) or accept(), lambda goal_id: None)

    def on_stop(_request: DeviceStopRequest, pending: Pending[DeviceCommandResponse]) -> None:
        action.refuse_waiting(because("command.overtaken", stop="stop"), pending.asked)
        pending.reply(DeviceCommandResponse(accepted=True))

    node.serve_later(DEVICE_STOP, on_stop)
    return node, action.epoch


def counted(node: Node, key: str) -> TopicStatistics:
    return next(each for each in node.statistics() if each.key == key)


def send(client: Bus, goal_id: str, epoch: int, answers: list[BusReply | None], number: int = 0) -> None:
    goal = encode(GoalRequest(goal_id=goal_id, client="test", goal=NO_GOAL, epoch=epoch))
    client.ask(GOAL, "GoalRequest", goal, 20.0, answers.append, number=number)


def test_a_goal_that_arrives_after_a_later_stop_is_refused_with_both_numbers(buses: Buses) -> None:
    started: list[str] = []
    (server, epoch), client, other = gateway(buses, started), buses.open(), buses.open()
    for each in (client, other):
        assert each.wait_served(GOAL, 5.0)
        assert each.wait_served(DEVICE_STOP.key, 5.0)
    late, others = client.take_number(), other.take_number()
    stops: list[BusReply | None] = []
    goals: list[BusReply | None] = []
    with spinning(server):
        client.ask(DEVICE_STOP.key, "DeviceStopRequest", encode(DeviceStopRequest()), 20.0, stops.append, True)
        assert until(lambda: len(stops) == 1)
        send(client, "stuck", epoch, goals, late)
        assert until(lambda: len(goals) == 1)
        send(client, "newer", epoch, goals)
        assert until(lambda: len(goals) == 2)
        send(other, "another's", epoch, goals, others)
        assert until(lambda: len(goals) == 3)
    refused, newer, anothers = goals
    assert refused is not None
    assert not refused.ok
    said = decode(Failure, refused.payload)
    assert said.kind == "void"
    assert f"this was request {late} of its client, the stop request {late + 1}" in said.message
    for answer in (newer, anothers):
        assert answer is not None
        assert decode(GoalResponse, answer.payload).accepted
    assert started == ["newer", "another's"]


@pytest.mark.parametrize(("answered", "tried"), [(0, keys.result_request(FOLLOW).key), (1, GOAL)])
def test_a_goal_that_is_tried_again_does_not_pass_a_stop_in_between(buses: Buses, answered: int, tried: str) -> None:
    """The epoch of the server is asked for first, then the goal is sent: the stop comes between tries of either."""
    started: list[str] = []
    rates = SoMany()
    (server, _), client = gateway(buses, started, rates), buses.node("script")
    rates.left = answered  # what comes after is dropped
    heard: list[BaseException] = []

    def send_goal() -> None:
        try:
            client.action(FOLLOW).send(FollowJointTrajectoryGoal(), timeout=20.0)
        except (RequestRefused, NoAnswer) as error:
            heard.append(error)

    sending = threading.Thread(target=send_goal)
    with spinning(server):
        sending.start()
        assert until(lambda: counted(server, tried).dropped)
        with pytest.raises(NoAnswer):  # it is carried out, but above the rate nothing is answered
            client.call(DEVICE_STOP, DeviceStopRequest())
        assert until(lambda: any(each.received for each in server.statistics() if each.key == DEVICE_STOP.key))
        rates.left = 1000
        sending.join(timeout=20.0)
    assert not sending.is_alive()
    (error,) = heard
    assert isinstance(error, RequestRefused)
    assert "the stop request" in str(error)
    assert not started
