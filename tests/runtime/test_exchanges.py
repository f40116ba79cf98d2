"""A server publishes each question with its answer, after the answer; not what a node is asked about itself."""

import msgspec
import pytest

from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.actions.server import accept
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.wire import MAX_PAYLOAD, MAX_PAYLOAD_OF
from gemelo.libraries.runtime.endpoints import info_request
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import GoalEnd, GoalStatusCode
from gemelo.schemas.device import DeviceCommandRequest, DeviceCommandResponse, DeviceStopRequest
from gemelo.schemas.message import decode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from gemelo.schemas.system import Exchange, ParameterChange
from gemelo.schemas.topics import (
    ACTIONS,
    DEVICE_COMMAND,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    PARAMETER_CHANGES,
    REQUESTS,
    TOPICS,
    exchange_topic,
)
from tests.runtime.support import spinning, until


class Parameters(msgspec.Struct, frozen=True, kw_only=True):
    speed: float = 1.0


@pytest.fixture
def network():
    return MemoryNetwork()


@pytest.fixture
def nodes(network):
    with Node("server", bus=MemoryBus(network)) as server, Node("client", bus=MemoryBus(network)) as client:
        yield server, client


def heard(network, topic):
    """What arrives on a topic from now on, decoded."""
    messages = []
    bus = MemoryBus(network)
    bus.subscribe(topic.key, topic.delivery, lambda a: messages.append(decode(topic.message, a.payload)), lambda n: 0)
    return messages


@pytest.mark.parametrize("request_", [DEVICE_COMMAND, DEVICE_STOP], ids=["queued", "urgent"])
def test_a_question_and_its_answer_are_published_once(nodes, network, request_):
    server, client = nodes
    said = heard(network, exchange_topic(request_))
    server.serve(request_, lambda question: DeviceCommandResponse(accepted=True, reason="done"))
    question = request_.request()
    with spinning(server):
        client.call(request_, question)
        assert until(lambda: said)
    (exchange,) = said
    assert decode(request_.request, bytes(exchange.question)) == question
    assert decode(DeviceCommandResponse, bytes(exchange.answer)).reason == "done"
    assert exchange.failure is None
    assert len(exchange.clients) == 1
    assert 0.0 <= exchange.duration < 5.0


def test_a_refusal_is_published_with_its_sentence(nodes, network):
    server, client = nodes
    said = heard(network, exchange_topic(DEVICE_COMMAND))

    def refuse(question):
        raise RequestRefused("the arm moves")

    server.serve(DEVICE_COMMAND, refuse)
    with spinning(server):
        with pytest.raises(RequestRefused, match="the arm moves"):
            client.call(DEVICE_COMMAND, DeviceCommandRequest())
        assert until(lambda: said)
    assert said[0].failure.message == "the arm moves"
    assert bytes(said[0].answer) == b"\xc0"


def test_who_asks_has_the_answer_before_anybody_hears_of_it(nodes, network):
    """A recording may not delay a stop."""
    server, client = nodes
    order = []
    topic = exchange_topic(DEVICE_STOP)
    MemoryBus(network).subscribe(topic.key, topic.delivery, lambda arrival: order.append("told"), lambda n: None)
    server.serve(DEVICE_STOP, lambda question: DeviceCommandResponse(accepted=True))
    with spinning(server):
        client.ask(DEVICE_STOP, DeviceStopRequest(), 2.0, lambda: order.append("answered"))
        assert until(lambda: len(order) == 2)
    assert order == ["answered", "told"]


def test_equal_stops_that_are_carried_out_together_are_told_once_with_all_who_asked(nodes, network):
    server, client = nodes
    said = heard(network, exchange_topic(DEVICE_STOP))
    server.serve(DEVICE_STOP, lambda question: DeviceCommandResponse(accepted=True))
    answered = []
    for _ in range(3):
        client.ask(DEVICE_STOP, DeviceStopRequest(), 2.0, lambda: answered.append(1))
    with spinning(server):
        assert until(lambda: len(answered) == 3 and said)
    assert len(said) == 1


def test_what_a_node_is_asked_about_itself_is_not_told(nodes, network):
    server, client = nodes
    with spinning(server):
        said = heard(network, exchange_topic(info_request("server")))
        info = client.call(info_request("server"), info_request("server").request())
    assert not said
    assert not [key for key in info.publishes if key.startswith("@")]


def test_the_end_of_a_goal_is_told_though_no_client_asks_for_it(nodes, network):
    server, client = nodes
    ends = heard(network, keys.ended_topic(FOLLOW_JOINT_TRAJECTORY))
    goals = heard(network, exchange_topic(keys.goal_request(FOLLOW_JOINT_TRAJECTORY)))
    action = server.serve_action(FOLLOW_JOINT_TRAJECTORY, lambda goal_id, goal: accept(), lambda goal_id: None)
    result = FollowJointTrajectoryResult(error_string="nothing to do")
    with spinning(server):
        handle = client.action(FOLLOW_JOINT_TRAJECTORY).send(FollowJointTrajectoryGoal())
        server.post(lambda: action.finish(handle.goal_id, GoalStatusCode.SUCCEEDED, result))
        assert until(lambda: ends and goals)
    assert type(ends[0]) is GoalEnd
    assert (ends[0].goal_id, ends[0].status) == (handle.goal_id, GoalStatusCode.SUCCEEDED)
    assert decode(FollowJointTrajectoryResult, bytes(ends[0].result)) == result


def test_a_parameter_that_is_set_is_told_with_its_new_value(nodes, network):
    server, _ = nodes
    changes = heard(network, PARAMETER_CHANGES)
    server.parameters(Parameters)
    server.set_parameter("speed", 2.5)
    with pytest.raises(RequestRefused):
        server.set_parameter("speed", "fast")
    (change,) = changes
    assert type(change) is ParameterChange
    assert (change.node, change.parameter.name, change.parameter.value) == ("server", "speed", 2.5)


def test_an_exchange_has_room_for_the_largest_question_and_answer():
    full = msgspec.Raw(msgspec.msgpack.encode(b"\0" * (MAX_PAYLOAD - 16)))
    exchange = Exchange(clients=("f" * 64,) * 64, question=full, answer=full)
    assert len(msgspec.msgpack.encode(exchange)) <= MAX_PAYLOAD_OF["Exchange"]


def test_no_message_that_is_told_has_a_field_for_a_secret():
    told = [row for row in REQUESTS if row.recorded]
    kinds = [kind for row in told for kind in (row.request, row.response)] + [row.message for row in TOPICS]
    kinds += [row.response for row in REQUESTS]
    kinds += [kind for row in ACTIONS for kind in (row.goal, row.feedback, row.result)]
    _, components = msgspec.json.schema_components(kinds)
    words = ("password", "secret", "credential", "private")
    names = [name for each in components.values() for name in each.get("properties", {})]
    assert names
    assert not [name for name in names if any(word in name.lower() for word in words)]
