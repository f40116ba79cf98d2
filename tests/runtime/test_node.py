"""The promises of a node to the service that is made of it, on either bus."""

from __future__ import annotations

import itertools
import threading
import time
from typing import Annotated

import msgspec
import pytest
from msgspec import Meta

from gemelo.libraries.recordings.living_topic import living_topic
from gemelo.libraries.runtime import topics
from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.endpoints import (
    info_request,
    interfaces_request,
    parameter_request,
    parameters_request,
)
from gemelo.libraries.runtime.errors import NoAnswer, NodeNameTaken, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.client import call
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.message import BadMessage, encode
from gemelo.schemas.planning import PlanCode, PlanRequest, PlanResponse
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.system import Empty, LogRecord, NodeStatistics, SetParameter, TopicInterface, TopicStatistics
from gemelo.schemas.topics import COMMAND_ACKS, DESCRIPTION, JOINT_STATES, LOG, PLAN, SCENE, STATISTICS, Request
from tests.runtime.support import Buses, hear, spinning, until


class GatewayParameters(msgspec.Struct, frozen=True, kw_only=True):
    """For these tests."""

    lead: Annotated[float, Meta(description="[s] ahead of the device", ge=0.1, le=1.0)] = 0.3
    chunk: Annotated[int, Meta(ge=1)] = 10
    is_strict: bool = True
    device: str = "rm1"
    rate: float = 50.0  # no bounds


def test_messages_reach_the_handler_in_the_thread_of_logic(buses: Buses) -> None:
    heard: list[tuple[JointState, int]] = []
    reader, writer = buses.node("reader"), buses.node("writer")
    reader.subscribe(JOINT_STATES, lambda message: heard.append((message, threading.get_ident())))
    message = JointState(stamp=1, name=("a",), position=(0.5,))
    buses.settle()
    writer.publisher(JOINT_STATES).put(message)
    assert hear(reader, lambda: heard)
    assert heard == [(message, threading.get_ident())]


def test_latest_conflates_while_its_reader_is_busy_and_counts_it(buses: Buses) -> None:
    heard: list[int] = []
    reader, writer = buses.node("reader"), buses.node("writer")
    subscription = reader.subscribe(JOINT_STATES, lambda message: heard.append(message.stamp))
    buses.settle()
    for stamp in range(1, 501):
        writer.publisher(JOINT_STATES).put(JointState(stamp=stamp))
    assert until(lambda: subscription.statistics.dropped == 499)
    reader.wait(0.1)
    assert heard == [500]


def test_a_batch_keeps_every_message_of_a_latest_topic_and_hands_them_over_together(buses: Buses) -> None:
    heard: list[int] = []
    times: list[float] = []
    reader, writer = buses.node("reader"), buses.node("writer")

    def on_message(message: JointState) -> None:
        heard.append(message.stamp)
        times.append(time.monotonic())

    reader.wait(0.01)
    subscription = reader.subscribe(JOINT_STATES, on_message, batch=0.2)
    buses.settle()
    reader.wait(0.05)  # the first batch, which is empty
    for stamp in range(1, 101):
        writer.publisher(JOINT_STATES).put(JointState(stamp=stamp))
        reader.wait(0.0005)
    assert hear(reader, lambda: len(heard) == 100)
    assert heard == list(range(1, 101))
    assert len({round(at * 20) for at in times}) <= 4
    assert subscription.statistics.dropped == 0
    subscription.close()
    writer.publisher(JOINT_STATES).put(JointState(stamp=101))
    reader.wait(0.3)
    assert len(heard) == 100


def test_a_reader_that_keeps_all_misses_nothing_of_a_latest_topic_while_it_is_busy(buses: Buses) -> None:
    heard: list[int] = []
    reader, writer = buses.node("reader"), buses.node("writer")
    subscription = reader.subscribe(JOINT_STATES, lambda message: heard.append(message.stamp), batch=0.0)
    buses.settle()
    for stamp in range(1, 201):  # the reader does something else
        writer.publisher(JOINT_STATES).put(JointState(stamp=stamp))
        time.sleep(0.0005)
    assert hear(reader, lambda: len(heard) == 200)
    assert heard == list(range(1, 201))
    assert subscription.statistics.dropped == 0


def test_every_keeps_order_through_a_node(buses: Buses) -> None:
    heard: list[int] = []
    reader, writer = buses.node("reader"), buses.node("writer")
    reader.subscribe(LOG, lambda message: heard.append(message.stamp))
    buses.settle()
    for stamp in range(1, 2001):
        writer.publisher(LOG).put(LogRecord(stamp=stamp))
    hear(reader, lambda: len(heard) == 2000)
    assert heard == list(range(1, 2001))


def test_an_overrun_of_every_is_counted_and_said_once(buses: Buses) -> None:
    said: list[LogRecord] = []
    reader, writer, observer = buses.node("reader"), buses.node("writer"), buses.node("observer")
    observer.subscribe(LOG, said.append)
    subscription = reader.subscribe(COMMAND_ACKS, lambda message: None)
    publisher = writer.publisher(COMMAND_ACKS)
    buses.settle()
    for seq in range(4096 + 500):
        publisher.put(COMMAND_ACKS.message(seq=seq))
    assert until(lambda: subscription.statistics.dropped == 500)
    with spinning(reader):
        assert until(lambda: subscription.statistics.received == 4096)
    assert hear(observer, lambda: said)
    assert len([record for record in said if "command_acks" in record.text]) == 1


def test_latest_knows_its_age(buses: Buses) -> None:
    reader, writer = buses.node("reader"), buses.node("writer")
    latest = reader.latest(JOINT_STATES)
    assert latest.message is None
    assert latest.is_stale
    assert latest.age() == float("inf")
    buses.settle()
    writer.publisher(JOINT_STATES).put(JointState(stamp=7))
    assert hear(reader, lambda: latest.message)
    assert latest.message == JointState(stamp=7)
    assert not latest.is_stale
    time.sleep(0.5)  # five periods of an arm at rest: more than one message has not come yet
    assert latest.is_stale
    assert 0.5 <= latest.age(reader.now()) < 0.9


def test_on_demand_only_what_is_looked_at_is_decoded_and_its_age_counts_from_when_it_came(
    buses: Buses, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded: list[bytes] = []
    decode = topics.from_arrival
    monkeypatch.setattr(topics, "from_arrival", lambda kind, at: decoded.append(at.payload) or decode(kind, at))
    reader, writer = buses.node("reader"), buses.node("writer")
    latest = reader.latest(JOINT_STATES, on_demand=True)
    assert latest.message is None
    buses.settle()
    for stamp in range(1, 101):
        writer.publisher(JOINT_STATES).put(JointState(stamp=stamp))
    assert until(lambda: figures(reader).received >= 99)  # the hundredth waits for somebody
    time.sleep(0.1)
    assert latest.is_stale  # nobody has spun: it was decoded in this thread
    assert latest.age() >= 0.1
    assert latest.message == JointState(stamp=100)
    assert len(decoded) == 1
    assert figures(reader).received == 100


def figures(node: Node) -> TopicStatistics:
    return next(each for each in node.statistics() if each.key == JOINT_STATES.key)


def test_on_demand_a_bad_message_leaves_the_one_before_and_is_counted(buses: Buses) -> None:
    reader, writer, stranger = buses.node("reader"), buses.node("writer"), buses.open()
    latest = reader.latest(JOINT_STATES, on_demand=True)
    buses.settle()
    writer.publisher(JOINT_STATES).put(JointState(stamp=3))
    assert until(lambda: latest.message)
    stranger.publish(JOINT_STATES.key, "JointState", JOINT_STATES.delivery).put(b"\xc1 not msgpack")
    assert until(lambda: latest.message and figures(reader).bad == 1)
    assert latest.message == JointState(stamp=3)


def test_bad_messages_are_dropped_counted_and_named_once(buses: Buses) -> None:
    heard: list[JointState] = []
    said: list[LogRecord] = []
    reader, observer = buses.node("reader"), buses.node("observer")
    observer.subscribe(LOG, said.append)
    subscription = reader.subscribe(JOINT_STATES, heard.append)
    stranger = buses.open()
    good, nan = encode(JointState(stamp=3)), msgspec.msgpack.encode({"position": [float("nan")]})
    attempts = [
        ("JointTargets", good), ("", good), ("JointState", b"\xc1 not msgpack"), ("JointState", nan),
        ("JointState", b""), ("JointState", bytes(1_000_000)), ("JointState", b"\x91" * 100_000),
    ]  # fmt: skip
    buses.settle()
    for index, (schema, payload) in enumerate(attempts):
        stranger.publish(JOINT_STATES.key, schema, JOINT_STATES.delivery).put(payload)
        assert hear(reader, lambda count=index + 1: subscription.statistics.bad == count)
    stranger.publish(JOINT_STATES.key, "JointState", JOINT_STATES.delivery).put(good)
    assert hear(reader, lambda: heard)
    assert hear(observer, lambda: said)
    assert heard == [JointState(stamp=3)]
    assert len(said) == 1
    assert "joint_states" in said[0].text
    assert "JointTargets" in said[0].text


def test_a_latched_message_is_taken_from_its_writer_alone(buses: Buses) -> None:
    """Of a stranger's that is valid but false nothing would be heard again until the writer's next."""
    heard: list[str] = []
    said: list[LogRecord] = []
    writer, reader, observer = buses.node("state_publisher"), buses.node("reader"), buses.node("observer")
    observer.subscribe(LOG, said.append)
    subscription = reader.subscribe(DESCRIPTION, lambda message: heard.append(message.urdf))
    buses.settle()
    lie = RobotDescription(urdf="a lie")
    buses.open().publish(DESCRIPTION.key, "RobotDescription", DESCRIPTION.delivery).put(encode(lie))
    observer.publisher(DESCRIPTION).put(lie)
    writer.publisher(DESCRIPTION).put(RobotDescription(urdf="the truth"))
    assert hear(reader, lambda: heard and subscription.statistics.bad == 2)
    assert hear(observer, lambda: said)
    late = buses.node("late").latest(DESCRIPTION)
    late_node = next(each for each in buses.opened if isinstance(each, Node) and each.name == "late")
    assert hear(late_node, lambda: late.message)
    assert late.message == RobotDescription(urdf="the truth")
    assert heard == ["the truth"]
    assert [record.text for record in said if record.node == "reader"] == [said[0].text]
    assert 'only "state_publisher" writes this key' in said[0].text


def test_a_latched_message_is_signed_by_the_process_that_bears_the_name(buses: Buses) -> None:
    living: dict[str, bool] = {}
    signed: dict[int, str] = {}
    reader = buses.node("reader")
    reader.watch_service("planner", living.__setitem__)
    reader.subscribe_signed(SCENE, lambda scene, instance: signed.update({scene.version: instance}))
    planner = buses.node("planner")
    buses.settle()
    planner.publisher(SCENE).put(PlanningScene(version=1))
    buses.open().publish(SCENE.key, "PlanningScene", SCENE.delivery, "planner").put(encode(PlanningScene(version=2)))
    assert hear(reader, lambda: len(signed) == 2 and living)
    assert planner.token.endswith(f"/{signed[1]}")
    assert signed == {1: signed[1], 2: ""}
    assert living == {signed[1]: True}
    planner.close()
    assert hear(reader, lambda: living == {signed[1]: False})


def test_a_publisher_takes_only_its_own_message_and_size(buses: Buses) -> None:
    node = buses.node("writer")
    with pytest.raises(TypeError, match="joint_states carries JointState, not JointTargets"):
        node.publisher(JOINT_STATES).put(JointTargets())  # type: ignore[arg-type]
    with pytest.raises(BadMessage, match="at most"):
        node.publisher(LOG).put(LogRecord(text="x" * 1_000_000))
    node.publisher(DESCRIPTION).put(RobotDescription(urdf="x" * 1_000_000))


def test_a_request_is_answered_refused_or_fails_with_a_reason(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")

    def plan(request: PlanRequest) -> PlanResponse:
        if request.velocity_scaling == 0.0:
            raise RequestRefused("velocity_scaling is 0: it must be in (0, 1]")
        if request.velocity_scaling < 0.0:
            raise ZeroDivisionError("oh")
        return PlanResponse(code=PlanCode.SUCCESS, duration=request.allowed_time)

    server.serve(PLAN, plan)
    with spinning(server):
        assert client.call(PLAN, PlanRequest(allowed_time=0.25)).duration == 0.25
        with pytest.raises(RequestRefused, match="velocity_scaling is 0"):
            client.call(PLAN, PlanRequest(velocity_scaling=0.0))
        with pytest.raises(RequestRefused, match="planner failed: ZeroDivisionError: oh"):
            client.call(PLAN, PlanRequest(velocity_scaling=-1.0))
        assert client.call(PLAN, PlanRequest()).code is PlanCode.SUCCESS


def test_a_bad_request_is_refused_with_its_reason(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    server.serve(PLAN, lambda request: PlanResponse())
    wrong = Request(PLAN.key, JointState, PlanResponse, "planner", "another schema under the planner's key")
    with spinning(server), pytest.raises(RequestRefused, match="JointState") as refusal:
        client.call(wrong, JointState())
    assert refusal.value.kind == "bad request"


def test_nobody_and_a_silent_server_are_told_apart(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    with pytest.raises(NoAnswer, match="nobody serves plan: is planner running"):
        client.call(PLAN, PlanRequest())
    server.serve(PLAN, lambda request: PlanResponse())  # and does not spin
    with pytest.raises(NoAnswer, match="did not answer plan within"):
        client.call(PLAN, PlanRequest(), timeout=0.3)


def test_who_asks_waits_for_a_server_that_just_starts_and_else_hears_that_nobody_serves(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    answered = threading.Event()
    with pytest.raises(NoAnswer, match="nobody serves plan: is planner running"):
        client.ask(PLAN, PlanRequest(), 0.3, answered.set)
    late = threading.Timer(0.1, lambda: server.serve(PLAN, lambda request: PlanResponse(code=PlanCode.SUCCESS)))
    late.start()
    call = client.ask(PLAN, PlanRequest(), 10.0, answered.set)
    late.join()
    with spinning(server):
        assert call.response().code is PlanCode.SUCCESS
    assert answered.wait(60.0)


def test_who_asks_at_once_waits_for_nobody(buses: Buses, monkeypatch: pytest.MonkeyPatch) -> None:
    for kind in (MemoryBus, ZenohBus):
        monkeypatch.setattr(kind, "wait_served", lambda bus, key, timeout: pytest.fail(f"it waits for {key}"))
    client = buses.node("client")
    answered = threading.Event()
    call = client.ask_at_once(PLAN, PlanRequest(), 10.0, answered.set)
    assert answered.wait(60.0), "the time-out is not waited for"
    with pytest.raises(NoAnswer, match="planner did not answer plan: it has just ended"):
        call.response()


def test_a_script_handles_its_inbox_while_it_waits_for_an_answer(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    heard: list[JointState] = []
    heard_at_ticks: list[int] = []
    client.subscribe(JOINT_STATES, heard.append)
    waiting: list[Pending[PlanResponse]] = []
    server.serve_later(PLAN, lambda request, pending: waiting.append(pending))
    states = server.publisher(JOINT_STATES)

    def step(now: int) -> None:
        states.put(JointState(stamp=now))
        if waiting and any(heard_at_ticks):
            waiting[0].reply(PlanResponse(code=PlanCode.SUCCESS))

    with spinning(server, step):
        answer = client.call(PLAN, PlanRequest(), timeout=10.0, on_tick=lambda: heard_at_ticks.append(len(heard)))
    assert answer.code is PlanCode.SUCCESS


def test_a_router_that_goes_while_an_answer_is_awaited_is_named_and_not_the_server() -> None:
    network = MemoryNetwork()
    server, client = MemoryBus(network), MemoryBus(network)
    server.serve(PLAN.key, lambda query: setattr(network, "is_connected", False))
    with pytest.raises(NoAnswer, match="the router is away"):
        call(client, PLAN, PlanRequest(), 0.1)


def test_an_answer_that_comes_too_late_harms_nobody(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    server.serve(PLAN, lambda request: time.sleep(request.allowed_time) or PlanResponse(code=PlanCode.SUCCESS))
    with spinning(server):
        with pytest.raises(NoAnswer, match=r"did not answer plan within 0\.1 s"):
            client.call(PLAN, PlanRequest(allowed_time=0.4), timeout=0.1)
        time.sleep(0.4)
        assert client.call(PLAN, PlanRequest(allowed_time=0.0)).code is PlanCode.SUCCESS
        impatient = buses.node("impatient")
        with pytest.raises(NoAnswer):
            impatient.call(PLAN, PlanRequest(allowed_time=0.4), timeout=0.1)
        impatient.close()
        time.sleep(0.4)
        assert client.call(PLAN, PlanRequest(allowed_time=0.0)).code is PlanCode.SUCCESS


def test_a_crowd_of_requests_is_told_that_the_server_is_busy(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.open()
    server.serve(PLAN, lambda request: PlanResponse())
    assert client.wait_served(PLAN.key, 1.0)
    answers: list[BusReply | None] = []
    for _ in range(100):
        client.ask(PLAN.key, "PlanRequest", encode(PlanRequest()), 2.0, answers.append)
    assert until(lambda: len(answers) == 36)
    assert all(b"requests are waiting already" in answer.payload for answer in answers)
    with spinning(server):
        assert until(lambda: len(answers) == 100)
        assert sum(answer.ok for answer in answers) == 64


def test_a_slow_handler_in_the_worker_does_not_hold_up_the_loop(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    steps, is_planning, has_gone_on = itertools.count(), threading.Event(), threading.Event()

    def plan(request: PlanRequest) -> PlanResponse:
        is_planning.set()
        return PlanResponse(code=PlanCode.SUCCESS if has_gone_on.wait(60.0) else PlanCode.TIMED_OUT)

    def step(now: int) -> None:
        if is_planning.is_set() and next(steps) == 10:
            has_gone_on.set()

    server.serve(PLAN, plan, worker=True)
    with spinning(server, step):
        assert client.call(PLAN, PlanRequest(), timeout=10.0).code is PlanCode.SUCCESS


def test_parameters_are_listed_set_and_checked_at_run_time(buses: Buses) -> None:
    node, client = buses.node("gateway", overrides={"chunk": "12"}), buses.node("client")
    parameters = node.parameters(GatewayParameters)
    list_all, set_one = parameters_request("gateway"), parameter_request("gateway")
    with spinning(node):
        listed = {each.name: each for each in client.call(list_all, Empty()).parameters}
        assert listed["chunk"].value == 12
        assert listed["chunk"].default == 10
        assert (listed["lead"].minimum, listed["lead"].maximum) == (0.1, 1.0)
        assert listed["lead"].description == "[s] ahead of the device"
        assert client.call(set_one, SetParameter(name="lead", value=0.5)).value == 0.5
        assert client.call(set_one, SetParameter(name="lead", value=1)).value == 1.0
        for name, value, reason in (
            ("lead", 1.5, "<= 1"), ("lead", "fast", "float"), ("leed", 0.5, 'did you mean "lead"'),
            ("chunk", 1.5, "int"), ("chunk", True, "is a int"), ("is_strict", 1, "is a bool"), ("lead", True, "float"),
        ):  # fmt: skip
            with pytest.raises(RequestRefused, match=reason):
                client.call(set_one, SetParameter(name=name, value=value))
    assert parameters.value == GatewayParameters(lead=1.0, chunk=12)


def test_a_parameter_takes_no_nul(buses: Buses) -> None:
    class Folders(msgspec.Struct, frozen=True, kw_only=True):
        log_dir: str = "here"

    node = buses.node("logger")
    folders = node.parameters(Folders)
    with pytest.raises(RequestRefused, match=r'logger: parameter "log_dir" cannot be .*NUL'):
        node.set_parameter("log_dir", "a\0b")
    assert folders.value.log_dir == "here"


def test_parameters_from_the_deployment_and_the_command_line_are_checked(buses: Buses) -> None:
    replace = msgspec.structs.replace
    buses.deployment = replace(buses.deployment, parameters={"gateway": {"lead": 0.7}})
    assert buses.node("gateway").parameters(GatewayParameters).value.lead == 0.7
    buses.deployment = replace(buses.deployment, parameters={"second": {"leda": 0.7}})
    with pytest.raises(RequestRefused, match=r'parameters.second.*did you mean "lead"'):
        buses.node("second").parameters(GatewayParameters)
    with pytest.raises(RequestRefused, match="--set: third"):
        buses.node("third", overrides={"chunk": "0"}).parameters(GatewayParameters)
    for name, number in (("fourth", "inf"), ("fifth", "-inf"), ("sixth", "nan")):
        with pytest.raises(RequestRefused, match=r'"rate" cannot be .* must be finite'):
            buses.node(name, overrides={"rate": number}).parameters(GatewayParameters)


def test_nodes_know_one_another(buses: Buses) -> None:
    planner, client = buses.node("planner"), buses.node("client")
    planner.publisher(LOG)
    planner.serve(PLAN, lambda request: PlanResponse())
    assert until(lambda: client.alive() == {"planner", "client"})
    with spinning(planner):
        info = client.call(info_request("planner"), Empty())
    assert (info.node, info.robot, info.serves) == ("planner", "rm1", ("plan",))
    planner.close()
    assert until(lambda: client.alive() == {"client"})


def test_a_reader_of_a_topic_of_which_it_has_only_the_fields_names_it_among_its_interfaces(buses: Buses) -> None:
    fields = (("value", "float"),)
    own = living_topic(TopicInterface(key="own/value", message="Own", fields=fields, delivery="every", writer="user"))
    logger, client = buses.node("logger"), buses.node("client")
    logger.subscribe(own, lambda message: None)
    assert until(lambda: client.alive() == {"logger", "client"})
    with spinning(logger):
        answer = client.call(interfaces_request("logger"), Empty())
    assert [each.fields for each in answer.topics if each.key == "own/value"] == [(("value", "Any"),)]


def test_a_name_has_one_bearer(buses: Buses) -> None:
    first = buses.node("planner")
    with pytest.raises(NodeNameTaken, match=r'another node named "planner" is alive \(process \d+'):
        buses.node("planner")
    first.close()
    buses.node("planner")
    with pytest.raises(ValueError, match="lower-case"):
        buses.node("Planner/1")


def test_of_two_that_start_together_one_stays(buses: Buses) -> None:
    made: list[Node] = []
    refused: list[NodeNameTaken] = []

    def start() -> None:
        try:
            made.append(buses.node("planner"))
        except NodeNameTaken as error:
            refused.append(error)

    starters = [threading.Thread(target=start) for _ in range(3)]
    for each in starters:
        each.start()
    for each in starters:
        each.join()
    assert (len(made), len(refused)) == (1, 2)


def test_a_node_that_replaces_a_dying_one_waits_for_its_end(buses: Buses) -> None:
    first = buses.node("planner")
    threading.Timer(0.5, first.close).start()
    buses.node("planner")


def test_the_log_reaches_the_bus(buses: Buses, capsys: pytest.CaptureFixture[str]) -> None:
    said: list[LogRecord] = []
    planner, observer = buses.node("planner"), buses.node("observer")
    observer.subscribe(LOG, said.append)
    buses.settle()
    planner.log.info("planned in %d ms", 3)
    assert hear(observer, lambda: said)
    assert [(record.node, record.level, record.text) for record in said] == [("planner", 20, "planned in 3 ms")]
    assert capsys.readouterr().err.endswith(" planner INFO planned in 3 ms\n")


def test_statistics_come_on_the_bus(buses: Buses) -> None:
    heard: list[NodeStatistics] = []
    planner, observer = buses.node("planner"), buses.node("observer")
    planner.latest(JOINT_STATES)
    observer.subscribe(STATISTICS, heard.append)
    with spinning(planner, rate=50.0):
        assert hear(observer, lambda: heard)
    assert heard[0].node == "planner"
    assert heard[0].loop_rate > 0.0
    assert "joint_states" in {topic.key for topic in heard[0].topics}


def test_what_was_closed_is_counted_and_told_no_more(buses: Buses) -> None:
    node = buses.node("reader")
    kept, closed = (node.subscribe(JOINT_STATES, lambda message: None) for _ in range(2))
    closed.close()
    assert [each.key for each in node.statistics()].count(JOINT_STATES.key) == 1
    kept.close()
    assert JOINT_STATES.key not in [each.key for each in node.statistics()]


def test_a_slow_step_does_not_starve_the_inbox(buses: Buses) -> None:
    reader, writer = buses.node("reader"), buses.node("writer")
    latest = reader.latest(JOINT_STATES)
    buses.settle()
    with spinning(reader, lambda now: time.sleep(0.02), rate=100.0):
        writer.publisher(JOINT_STATES).put(JointState(stamp=5))
        assert until(lambda: latest.message is not None)


def test_what_a_callback_raises_ends_the_spin(buses: Buses) -> None:
    reader, writer = buses.node("reader"), buses.node("writer")

    def fail(message: JointState) -> None:
        raise ZeroDivisionError("in a callback")

    reader.subscribe(JOINT_STATES, fail)
    buses.settle()
    writer.publisher(JOINT_STATES).put(JointState())
    with pytest.raises(ZeroDivisionError, match="in a callback"):
        reader.spin()


def test_waiting_inside_a_callback_is_refused(buses: Buses) -> None:
    node = buses.node("reader")
    with pytest.raises(RuntimeError, match="cannot be called from a callback"):
        node.spin(lambda now: node.wait(0.1))


def test_readiness_is_a_file_that_is_kept_fresh(buses: Buses) -> None:
    from pathlib import Path

    node = buses.node("planner")
    file = Path(node.deployment.paths.run) / "planner.ready"
    problem = file.with_suffix(".problem")
    node.set_ready(False, "no description yet")
    assert not file.exists()
    assert problem.read_text() == "no description yet\n"
    with spinning(node):
        node.set_ready(True)
        assert not problem.exists()
        first = file.stat().st_mtime
        assert file.read_text() == f"{node.info().pid}\n"
        assert until(lambda: file.stat().st_mtime > first)
        node.set_ready(False, "no joint states for 2 s")
        assert not file.exists()
        assert problem.read_text() == "no joint states for 2 s\n"
        node.set_ready(False, "no joint states at all")
        assert problem.read_text() == "no joint states at all\n"
        node.set_ready(True)
        node.set_ready(False, "the last word")
    assert not file.exists()
    assert not problem.exists()
