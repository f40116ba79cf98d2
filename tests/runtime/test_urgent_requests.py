"""Urgent requests pass everything that waits, and one client's flood shuts out nobody, on either bus."""

from __future__ import annotations

import signal
import threading
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.runtime.actions import keys as keys
from gemelo.libraries.runtime.actions.server import accept
from gemelo.libraries.runtime.bus.interface import Bus, BusReply, Query
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_declarations import QUERIES
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.limits import MAX_WAITING_OF_A_CLIENT, RequestRates
from gemelo.libraries.runtime.requests.server import MAX_UNANSWERED, Pending
from gemelo.schemas.actions import CancelRequest, CancelResponse, GoalRequest, GoalResponse
from gemelo.schemas.device import DeviceCommandResponse, DeviceStopRequest, StopKind
from gemelo.schemas.message import Message, decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import PlanCode, PlanRequest, PlanResponse
from gemelo.schemas.reasons import because
from gemelo.schemas.system import Failure
from gemelo.schemas.topics import DEVICE_STOP, PLAN
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW
from tests.runtime.support import Buses, RouterProcess, hear, spinning, until

FROZEN = 1.5  # [s] of the router: longer than the lease of its links
FLOOD = 400  # requests at once: within a client's burst, above what may wait

Answers = list[BusReply | None]


def ask(client: Bus, key: str, question: Message, answers: Answers, timeout: float = 5.0) -> None:
    client.ask(key, type(question).__name__, encode(question), timeout, answers.append, True)


def words(answer: BusReply | None) -> str:
    assert answer is not None
    return decode(Failure, answer.payload).message


def test_an_urgent_request_is_handled_before_all_that_waits(buses: Buses) -> None:
    server, client = buses.node("gateway"), buses.open()
    handled: list[str] = []
    server.serve(PLAN, lambda request: handled.append("plan") or PlanResponse())
    server.serve(DEVICE_STOP, lambda request: handled.append("stop") or DeviceCommandResponse(accepted=True))
    assert client.wait_served(PLAN.key, 1.0)
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers: Answers = []
    for _ in range(MAX_WAITING_OF_A_CLIENT):
        ask(client, PLAN.key, PlanRequest(), answers)
    refused: Answers = []
    ask(client, PLAN.key, PlanRequest(), refused)  # its answer says that the others have arrived
    assert until(lambda: len(refused) == 1)
    stopped: Answers = []
    ask(client, DEVICE_STOP.key, DeviceStopRequest(), stopped)
    assert until(lambda: _received(server) == 1)
    assert hear(server, lambda: len(handled) == MAX_WAITING_OF_A_CLIENT + 1)
    assert handled == ["stop"] + ["plan"] * MAX_WAITING_OF_A_CLIENT


def test_a_stop_is_handled_before_all_urgent_requests_that_wait_holds_too(buses: Buses) -> None:
    server, client = buses.node("gateway"), buses.open()
    handled: list[str] = []
    cancel = keys.cancel_request(FOLLOW)
    server.serve(cancel, lambda asked: handled.append("cancel") or CancelResponse())
    server.serve(DEVICE_STOP, lambda asked: handled.append(asked.kind) or DeviceCommandResponse(accepted=True))
    assert client.wait_served(cancel.key, 1.0)
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers: Answers = []
    for number in range(MAX_WAITING_OF_A_CLIENT):
        ask(client, cancel.key, CancelRequest(goal_id=str(number)), answers)
    assert until(lambda: _received(server, cancel.key) == MAX_WAITING_OF_A_CLIENT)
    for kind in (StopKind.HOLD, StopKind.DISARM):
        ask(client, DEVICE_STOP.key, DeviceStopRequest(kind=kind), answers)
    assert until(lambda: _received(server) == 2)
    stopped: Answers = []
    ask(client, DEVICE_STOP.key, DeviceStopRequest(), stopped)
    assert until(lambda: _received(server) == 3)
    assert hear(server, lambda: len(handled) == MAX_WAITING_OF_A_CLIENT + 3)
    assert handled == ["stop"] + ["cancel"] * MAX_WAITING_OF_A_CLIENT + ["hold", "disarm"]
    assert until(lambda: len(answers) + len(stopped) == len(handled))


def test_a_stop_is_read_before_the_holds_that_have_arrived_before_it(router: RouterProcess) -> None:
    server, client = (ZenohBus(router.deployment.router, "rm1") for _ in range(2))
    is_released, has_arrived = threading.Event(), threading.Event()
    read: list[bytes] = []

    def read_slowly(query: Query) -> None:
        read.append(query.arrival.payload)
        is_released.wait(60.0)
        query.drop()

    def note(query: Query) -> None:
        has_arrived.set()
        query.drop()

    hold, stop = (encode(DeviceStopRequest(kind=kind)) for kind in (StopKind.HOLD, StopKind.STOP))
    try:
        server.serve(DEVICE_STOP.key, read_slowly, True, lambda payload: payload == stop)
        server.serve("after", note, True)
        assert client.wait_served(DEVICE_STOP.key, 2.0)
        assert client.wait_served("after", 2.0)
        for payload in (*[hold] * 300, stop):
            client.ask(DEVICE_STOP.key, DeviceStopRequest.__name__, payload, 60.0, lambda answer: None, True)
        client.ask("after", "", b"", 60.0, lambda answer: None, True)  # on the same way, behind all of them
        assert has_arrived.wait(10.0)
        is_released.set()
        assert until(lambda: len(read) == 301)
    finally:
        is_released.set()
        for bus in (server, client):
            bus.close()
    assert stop in read[:2]  # the first hold may be read before it has arrived
    assert read.count(hold) == 300


def test_equal_stops_that_wait_are_handled_once_and_all_answered(buses: Buses) -> None:
    server, client = buses.node("gateway"), buses.open()
    handled: list[StopKind] = []
    server.serve(DEVICE_STOP, lambda request: handled.append(request.kind) or DeviceCommandResponse(accepted=True))
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers: Answers = []
    for _ in range(200):
        ask(client, DEVICE_STOP.key, DeviceStopRequest(), answers)
    ask(client, DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.HOLD), answers)
    assert until(lambda: _received(server) == 201)
    with spinning(server):
        assert until(lambda: len(answers) == 201)
    assert handled == [StopKind.STOP, StopKind.HOLD]
    assert all(answer is not None and answer.ok for answer in answers)


def _received(server, key: str = DEVICE_STOP.key) -> int:
    return sum(each.received for each in server.statistics() if each.key == key)


class Unlimited(RequestRates):
    """Answers whoever asks."""

    def permit_request(self, principal: str, client: str, urgent: bool = False) -> bool:
        return True


def test_stops_are_carried_out_however_many_callers_wait(buses: Buses) -> None:
    server, client = buses.node("gateway", rates=Unlimited()), buses.open()
    pendings: list[Pending[DeviceCommandResponse]] = []
    server.serve_later(DEVICE_STOP, lambda request, pending: pendings.append(pending))
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers: Answers = []
    for _ in range(MAX_UNANSWERED + 1):
        ask(client, DEVICE_STOP.key, DeviceStopRequest(), answers)
    assert until(lambda: len(answers) == 1)
    assert "taken; 1024 callers wait for its answer already" in words(answers[0])
    assert hear(server, lambda: pendings)
    taken = len(pendings)
    ask(client, DEVICE_STOP.key, DeviceStopRequest(), answers)
    assert hear(server, lambda: len(pendings) == taken + 1)


def test_a_bad_stop_is_refused_where_it_arrives(buses: Buses) -> None:
    server, client = buses.node("gateway"), buses.open()
    server.serve(DEVICE_STOP, lambda request: DeviceCommandResponse(accepted=True))
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers: Answers = []
    client.ask(DEVICE_STOP.key, "DeviceStopRequest", b"\x81\xa4kind\xa3fly", 2.0, answers.append, True)
    assert until(lambda: len(answers) == 1)
    assert "fly" in words(answers[0])


def test_the_flood_of_one_client_leaves_room_for_another(buses: Buses) -> None:
    server, flooder, client = buses.node("planner"), buses.open(), buses.open()
    server.serve(PLAN, lambda request: PlanResponse(code=PlanCode.SUCCESS))
    assert flooder.wait_served(PLAN.key, 1.0)
    assert client.wait_served(PLAN.key, 1.0)
    flood: Answers = []
    for _ in range(FLOOD):
        ask(flooder, PLAN.key, PlanRequest(), flood)
    assert until(lambda: len(flood) == FLOOD - MAX_WAITING_OF_A_CLIENT)
    assert "requests are waiting already, all of this client" in words(flood[0])
    answers: Answers = []
    ask(client, PLAN.key, PlanRequest(), answers)
    with spinning(server):
        assert until(lambda: len(answers) == 1)
    assert answers[0] is not None
    assert answers[0].ok


def test_what_a_stop_has_overtaken_is_refused(buses: Buses) -> None:
    server, client = buses.node("gateway"), buses.open()
    started: list[str] = []
    action = server.serve_action(
        FOLLOW, lambda goal_id, goal: started.append(goal_id) or accept(), lambda goal_id: None
    )

    def stop(request: DeviceStopRequest) -> DeviceCommandResponse:
        action.refuse_waiting(because("command.overtaken", stop="stop"), {})
        return DeviceCommandResponse(accepted=True)

    server.serve(DEVICE_STOP, stop)
    goal_key = keys.goal_request(FOLLOW).key
    assert client.wait_served(goal_key, 1.0)
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    goals: Answers = []
    for _ in range(MAX_WAITING_OF_A_CLIENT + 1):  # the answer to the last one says that the others have arrived
        ask(client, goal_key, _goal("early", action.epoch), goals)
    assert until(lambda: len(goals) == 1)
    stops: Answers = []
    ask(client, DEVICE_STOP.key, DeviceStopRequest(), stops)
    assert until(lambda: _received(server) == 1)
    with spinning(server):
        assert until(lambda: len(goals) == MAX_WAITING_OF_A_CLIENT + 1 and len(stops) == 1)
        assert "was asked for after it" in words(goals[1])
        assert not started
        ask(client, goal_key, _goal("later", action.epoch), goals)
        assert until(lambda: started == ["later"])


def test_a_goal_that_its_own_cancel_has_overtaken_does_not_start(buses: Buses) -> None:
    server, client = buses.node("gateway"), buses.open()
    started: list[str] = []
    action = server.serve_action(
        FOLLOW, lambda goal_id, goal: started.append(goal_id) or accept(), lambda goal_id: None
    )
    goal_key, cancel_key = keys.goal_request(FOLLOW).key, keys.cancel_request(FOLLOW).key
    assert client.wait_served(goal_key, 1.0)
    assert client.wait_served(cancel_key, 1.0)
    with spinning(server):
        cancels: Answers = []
        ask(client, cancel_key, CancelRequest(goal_id="g"), cancels)
        assert until(lambda: len(cancels) == 1)
        assert cancels[0] is not None
        assert "within 2 s is refused" in decode(CancelResponse, cancels[0].payload).reason
        goals: Answers = []
        ask(client, goal_key, _goal("g", action.epoch), goals)
        assert until(lambda: len(goals) == 1)
    assert goals[0] is not None
    assert decode(GoalResponse, goals[0].payload).reason == "it was cancelled before it was looked at"
    assert not started


def _goal(goal_id: str, epoch: int) -> GoalRequest:
    goal = msgspec.Raw(encode(FollowJointTrajectoryGoal()))
    return GoalRequest(goal_id=goal_id, client="c", goal=goal, epoch=epoch)


def test_a_flood_of_stops_that_are_not_read_in_time_fills_no_link_but_its_own(router: RouterProcess) -> None:
    server, flooder, client = (ZenohBus(router.deployment.router, "rm1") for _ in range(3))
    is_released, is_blocked = threading.Event(), threading.Event()

    def block(query: Query) -> None:
        is_blocked.set()
        is_released.wait(60.0)
        query.drop()

    try:
        server.serve(DEVICE_STOP.key, block, True)
        server.serve(PLAN.key, lambda query: query.reply(PlanResponse.__name__, encode(PlanResponse())))
        assert flooder.wait_served(DEVICE_STOP.key, 2.0)
        assert client.wait_served(PLAN.key, 2.0)
        dropped: Answers = []
        for _ in range(QUERIES + 200):  # more than wait in the server's channel
            ask(flooder, DEVICE_STOP.key, DeviceStopRequest(), dropped)
        assert is_blocked.wait(60.0)
        for _ in range(5):
            answers: Answers = []
            ask(client, PLAN.key, PlanRequest(), answers, timeout=2.0)
            assert until(lambda answers=answers: answers)  # type: ignore[misc]
            assert answers[0] is not None
    finally:
        is_released.set()
        for bus in (server, flooder, client):
            bus.close()


def test_a_stop_is_sent_again_until_a_router_that_was_frozen_passes_it_on(tmp_path: Path) -> None:
    router = RouterProcess(tmp_path)
    handled: list[StopKind] = []
    with (
        Node("stepper_gateway", router.deployment, robot="rm1") as server,
        Node("client", router.deployment, robot="rm1") as client,
        spinning(server),
    ):
        server.serve(DEVICE_STOP, lambda asked: handled.append(asked.kind) or DeviceCommandResponse(accepted=True))
        assert client.call(DEVICE_STOP, DeviceStopRequest(), timeout=5.0).accepted
        router.process.send_signal(signal.SIGSTOP)
        thaw = threading.Timer(FROZEN, router.process.send_signal, (signal.SIGCONT,))
        thaw.start()
        assert client.call(DEVICE_STOP, DeviceStopRequest(kind=StopKind.HOLD), timeout=15.0).accepted
        thaw.join()
    assert StopKind.HOLD in handled
    router.stop()


def test_a_stop_that_nobody_answers_says_what_is_known(buses: Buses) -> None:
    server, client = buses.open(), buses.node("client")
    served = server.serve(DEVICE_STOP.key, lambda query: query.drop(), urgent=True)
    assert client.is_served(DEVICE_STOP) or until(lambda: client.is_served(DEVICE_STOP))
    with pytest.raises(NoAnswer, match=r"within 0.3 s, sent [3-9] times: it is alive, and carries out what arrives"):
        client.call(DEVICE_STOP, DeviceStopRequest(), timeout=0.3)
    call = client.ask(DEVICE_STOP, DeviceStopRequest(), 0.5, lambda: None)
    served.close()
    with pytest.raises(NoAnswer, match=r"nobody serves it now .* whether it was carried out is not known"):
        call.response()
