"""Nothing that a table allows is too large for the bus, and what is larger is refused with size, limit and remedy."""

from __future__ import annotations

import msgspec
import pytest
from _pytest.mark.structures import ParameterSet

from gemelo.libraries.arm.stl import MAX_TRIANGLES
from gemelo.libraries.runtime.actions.keys import goal_request, status_topic
from gemelo.libraries.runtime.actions.server import accept, refuse
from gemelo.libraries.runtime.bus.wire import LARGEST, MAX_PAYLOAD, MAX_PAYLOAD_OF, TooLarge, encoded, limit_of
from gemelo.libraries.runtime.bus.zenoh_config import MAX_MESSAGE_BYTES
from gemelo.libraries.runtime.errors import GoalRefused, RequestRefused
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.libraries.runtime.requests.limits import MAX_WAITING_BYTES, MAX_WAITING_BYTES_OF_A_CLIENT, WaitingRequests
from gemelo.libraries.runtime.requests.server import MAX_REASON
from gemelo.schemas.actions import GoalRequest
from gemelo.schemas.message import Message, encode
from gemelo.schemas.motion import MOST_POINTS, FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest, PlanResponse, Refusal, WaypointGoal
from gemelo.schemas.reasons import because, remedy, say
from gemelo.schemas.scene import MeshShape, SceneAdd, SceneObject, SceneRequest, SceneResponse
from gemelo.schemas.system import Exchange, LogRecord
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND, LOG, PLAN, SCENE_EDIT, exchange_topic
from tests.runtime.conftest import Buses
from tests.runtime.support import hear, spinning

EIGHT = tuple(f"joint_{index}" for index in range(1, 9))
LIMITS: list[ParameterSet] = [pytest.param(name, limit, id=name) for name, limit in sorted(MAX_PAYLOAD_OF.items())]


def trajectory(points: int, names: tuple[str, ...] = EIGHT) -> JointTrajectory:
    """Points with everything that a point may have."""
    row = (0.123456789,) * len(names)
    made = (
        TrajectoryPoint(positions=row, velocities=row, accelerations=row, time_from_start=0.02 * (index + 1))
        for index in range(points)
    )
    return JointTrajectory(joint_names=names, points=tuple(made))


def add_mesh(size: int) -> SceneRequest:
    return SceneRequest(edit=SceneAdd(object=SceneObject(name="part", shape=MeshShape(data=bytes(size)))))


def test_what_the_gateway_and_the_planner_take_fits_into_a_message() -> None:
    goal = FollowJointTrajectoryGoal(trajectory=trajectory(1000))
    assert len(encode(goal)) * MOST_POINTS / 1000 < limit_of("GoalRequest") < limit_of("GatewayInputs")
    assert len(encode(PlanResponse(trajectory=trajectory(1000)))) * MOST_POINTS / 1000 < limit_of("PlanResponse")
    via = (JointGoal(name=EIGHT, position=(0.1,) * 8),) * 1000
    assert len(encode(PlanRequest(goal=WaypointGoal(points=via)))) * 10 < limit_of("PlanRequest")
    assert limit_of("SceneRequest") > 84 + 50 * MAX_TRIANGLES


def test_an_exchange_has_room_for_the_largest_question_with_its_answer_and_the_bus_for_every_message() -> None:
    pairs = [(request.request, request.response) for request in (PLAN, SCENE_EDIT)]
    largest = max(limit_of(asked.__name__) + limit_of(answer.__name__) for asked, answer in pairs)
    assert largest + MAX_PAYLOAD // 2 < limit_of(Exchange.__name__) <= LARGEST < MAX_MESSAGE_BYTES


@pytest.mark.parametrize(("name", "limit"), [*LIMITS, pytest.param("LogRecord", MAX_PAYLOAD, id="any other")])
def test_a_message_above_its_limit_names_size_limit_and_remedy(name: str, limit: int) -> None:
    kind = msgspec.defstruct(name, [("data", bytes)], bases=(Message,), frozen=True, kw_only=True)
    assert len(encoded(kind(data=bytes(limit - 32))).payload) <= limit
    with pytest.raises(TooLarge, match=rf"^{limit + 1 + 7 + 4} bytes: a {name} has at most {limit}; \w+") as refused:
        encoded(kind(data=bytes(limit + 1)))
    why = refused.value.reason
    assert (why.code, why.values) == ("message.too_large", {"message": name, "size": limit + 12, "limit": limit})
    assert say(why, "es").startswith(f"{limit + 12} bytes: un mensaje {name} tiene como máximo {limit}; ")


def test_a_mesh_of_25_megabytes_is_asked_and_recorded_whole(buses: Buses) -> None:
    server, client, recorder = buses.node("planner"), buses.node("client"), buses.node("logger")
    sizes: list[int] = []
    recorder.subscribe(exchange_topic(SCENE_EDIT), lambda exchange: sizes.append(len(bytes(exchange.question))))
    buses.settle()

    def edit(request: SceneRequest) -> SceneResponse:
        assert isinstance(request.edit, SceneAdd)
        assert isinstance(request.edit.object.shape, MeshShape)
        return SceneResponse(accepted=True, version=len(request.edit.object.shape.data))

    server.serve(SCENE_EDIT, edit)
    with spinning(server):
        assert client.call(SCENE_EDIT, add_mesh(25_000_000), timeout=20.0).version == 25_000_000
        assert hear(recorder, lambda: sizes, 20.0)
    assert sizes[0] > 25_000_000


def test_a_plan_of_thirty_thousand_points_is_answered_and_a_larger_one_refused_by_a_server_that_goes_on(
    buses: Buses,
) -> None:
    server, client = buses.node("planner"), buses.node("client")
    long, far = PlanResponse(code=PlanCode.SUCCESS, trajectory=trajectory(30_000)), Refusal(message="x" * 40_000_000)

    def plan(request: PlanRequest) -> PlanResponse:
        return long if request.request_id == "long" else PlanResponse(refusal=far)

    server.serve(PLAN, plan)
    with spinning(server):
        assert client.call(PLAN, PlanRequest(request_id="long"), timeout=20.0) == long
        limit = limit_of("PlanResponse")
        with pytest.raises(RequestRefused, match=rf"40000\d+ bytes: a PlanResponse has at most {limit}; split") as late:
            client.call(PLAN, PlanRequest(), timeout=20.0)
        assert late.value.reason.code == "message.too_large"
        assert client.call(PLAN, PlanRequest(request_id="long"), timeout=20.0).code is PlanCode.SUCCESS


def test_a_question_above_its_limit_is_refused_where_it_is_asked(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.node("client")
    server.serve(SCENE_EDIT, lambda request: SceneResponse(accepted=True))
    with spinning(server):
        with pytest.raises(
            RequestRefused, match=r"40000\d+ bytes: a SceneRequest has at most \d+; add the objects one"
        ) as early:
            client.call(SCENE_EDIT, add_mesh(40_000_000))
        assert early.value.reason.remedies == (remedy("add_one_by_one"),)
        assert client.call(SCENE_EDIT, add_mesh(0)).accepted


def test_a_goal_of_a_hundred_thousand_points_arrives_and_what_a_server_says_of_it_has_an_end(buses: Buses) -> None:
    server, client = buses.node("stepper_gateway"), buses.node("client")
    goal, found = FollowJointTrajectoryGoal(trajectory=trajectory(MOST_POINTS)), []

    def on_goal(goal_id: str, goal: FollowJointTrajectoryGoal) -> object:
        found.append(len(goal.trajectory.points))
        return refuse(1, "no" * 1_000_000)

    server.serve_action(FOLLOW_JOINT_TRAJECTORY, on_goal, lambda goal_id: None)  # type: ignore[arg-type]
    with spinning(server):
        with pytest.raises(GoalRefused) as refused:
            client.action(FOLLOW_JOINT_TRAJECTORY).send(goal)
        assert len(str(refused.value)) <= MAX_REASON + 5
    assert found == [MOST_POINTS]


def test_a_name_without_an_end_is_refused_before_every_status_would_carry_it(buses: Buses) -> None:
    server, client = buses.node("stepper_gateway"), buses.node("client")
    server.serve_action(GRIPPER_COMMAND, lambda goal_id, goal: accept(), lambda goal_id: None)
    statuses = client.latest(status_topic(GRIPPER_COMMAND))
    with spinning(server):
        for request in (GoalRequest(goal_id="x" * 600_000), GoalRequest(goal_id="g", client="c" * 600_000)):
            with pytest.raises(RequestRefused, match="has 600000 characters: at most 256; give a shorter one"):
                client.call(goal_request(GRIPPER_COMMAND), request, timeout=5.0)
        assert hear(client, lambda: statuses.message)
    assert statuses.message is not None
    assert statuses.message.goals == ()


def test_a_failing_handler_ends_a_script_and_not_a_service(buses: Buses, capsys: pytest.CaptureFixture[str]) -> None:
    writer, texts = buses.node("writer"), {"script": [], "service": []}  # type: dict[str, list[str]]

    def take(name: str, record: LogRecord) -> None:
        if record.text == "bad":
            raise ZeroDivisionError("oh")
        texts[name].append(record.text)

    script, service = buses.node("script"), buses.node("service", stop=ShutdownRequest())
    script.subscribe(LOG, lambda record: take("script", record))
    service.subscribe(LOG, lambda record: take("service", record))
    buses.settle()
    for text in ("one", "bad", "two"):
        writer.publisher(LOG).put(LogRecord(node="writer", text=text))
    assert hear(service, lambda: texts["service"] == ["one", "two"])
    assert "a handler failed; what it was given is lost, and the service goes on" in capsys.readouterr().err
    with pytest.raises(ZeroDivisionError):
        hear(script, lambda: "two" in texts["script"])


def test_what_waits_in_a_server_is_bounded_in_bytes_for_one_client_and_for_all() -> None:
    waiting, half = WaitingRequests("plan"), MAX_WAITING_BYTES_OF_A_CLIENT // 2
    assert not waiting.refusal("local", "a", half)
    assert not waiting.refusal("local", "a", half)
    most = MAX_WAITING_BYTES_OF_A_CLIENT
    too_many = because("waiting.client.bytes", key="plan", size=1, waiting=2 * half, limit=most)
    assert waiting.refusal("local", "a", 1) == too_many
    assert str(too_many).startswith(f"plan: 1 bytes, and {2 * half} bytes of this client's requests are waiting")
    assert not waiting.refusal("local", "b", 2 * half)
    assert f"at most {MAX_WAITING_BYTES}" in str(waiting.refusal("local", "c", half))
    waiting.leave("local", "a", half)
    assert not waiting.refusal("local", "c", half)


def test_a_publication_that_is_encoded_before_is_sent_as_it_is(buses: Buses) -> None:
    reader, writer = buses.node("reader"), buses.node("writer")
    texts: list[str] = []
    reader.subscribe(LOG, lambda record: texts.append(record.text))
    buses.settle()
    publisher = writer.publisher(LOG)
    ready = publisher.encoded(LogRecord(node="writer", text="ready"))
    publisher.put(ready)
    publisher.put(ready)
    assert hear(reader, lambda: texts == ["ready", "ready"])
    with pytest.raises(TypeError, match="log carries LogRecord, not SceneResponse"):
        publisher.put(encoded(SceneResponse()))  # type: ignore[arg-type]
