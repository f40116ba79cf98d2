"""A node under a flood of requests: its answers, the clients beside it, and stops that are carried out all the same."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from gemelo.libraries.runtime.actions.client import PAUSE
from gemelo.libraries.runtime.actions.server import accept
from gemelo.libraries.runtime.bus.interface import UNREAD, Bus, BusReply, Query
from gemelo.libraries.runtime.bus.pace import Pace, Rate
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_declarations import QUERIES
from gemelo.libraries.runtime.clock import SystemClock
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.limits import (
    KNOWN_AFTER,
    MAX_CLIENTS,
    MAX_PRINCIPALS,
    MAX_WAITING,
    MAX_WAITING_OF_A_CLIENT,
    MAX_WAITING_OF_A_PRINCIPAL,
    OF_A_CLIENT,
    OF_A_PRINCIPAL,
    OF_NEWCOMERS,
    OF_REFUSALS,
    RequestRates,
    WaitingRequests,
)
from gemelo.libraries.runtime.requests.server import REPEAT
from gemelo.schemas.device import DeviceCommandResponse, DeviceStopRequest, StopKind
from gemelo.schemas.message import Message, decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import PlanRequest, PlanResponse
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DEVICE_STOP, FOLLOW_JOINT_TRAJECTORY, PLAN
from tests.runtime.support import Buses, RouterProcess, hear, spinning, until

Answers = list[BusReply | None]


class SetClock(SystemClock):
    """Its [s] monotonic are as a test sets them."""

    now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock() -> SetClock:
    return SetClock()


@pytest.mark.parametrize("urgent", [False, True])
def test_a_flood_under_ever_new_names_gets_what_one_client_gets(clock: SetClock, urgent: bool) -> None:
    rates, seconds = RequestRates(clock=clock), 10
    for _ in range(2):  # known from the second time on
        assert rates.permit_request("viewer.desk", "known", urgent)
        clock.now += KNOWN_AFTER
    permitted = 0
    for number in range(seconds * 5000):
        clock.now += 1 / 5000
        permitted += rates.permit_request("viewer.desk", f"forged {number}", urgent)
        if number % 5000 == 0:  # whoever was there before is not touched, nor those of other certificates
            assert rates.permit_request("viewer.desk", "known", urgent)
            assert rates.permit_request("operator.desk", f"gemelo stop {number}", urgent)
    assert permitted <= OF_NEWCOMERS.burst / (1 - OF_NEWCOMERS.per_second / 5000)


def test_clients_that_were_known_before_they_flood_get_three_times_what_one_gets(clock: SetClock) -> None:
    rates, seconds, names = RequestRates(clock=clock), 10, 2 * MAX_CLIENTS
    for number in range(names):
        clock.now += 1 / OF_NEWCOMERS.per_second
        rates.permit_request("viewer.desk", f"client {number}")
    clock.now += KNOWN_AFTER
    permitted = 0
    for number in range(seconds * 5000):
        clock.now += 1 / 5000
        permitted += rates.permit_request("viewer.desk", f"client {number % names}")
    assert permitted <= OF_A_PRINCIPAL.burst + OF_A_PRINCIPAL.per_second * seconds + 1
    assert rates.permit_request("operator.desk", "gemelo move")


def test_principals_without_end_share_one_place(clock: SetClock) -> None:
    rates = RequestRates(clock=clock)
    permitted = sum(rates.permit_request(f"viewer.host{number}", "a") for number in range(100 * MAX_PRINCIPALS))
    assert permitted <= 2 * MAX_PRINCIPALS + OF_NEWCOMERS.burst


def test_requests_that_wait_under_forged_names_leave_room_for_other_certificates() -> None:
    waiting = WaitingRequests("plan")
    refused = [waiting.refusal("viewer.desk", f"forged {number}") for number in range(2 * MAX_WAITING)]
    assert refused.count(None) == MAX_WAITING_OF_A_PRINCIPAL
    most = MAX_WAITING_OF_A_PRINCIPAL
    assert refused[-1] == because("waiting.certificate", key="plan", count=most, certificate="viewer.desk")
    assert not waiting.refusal("operator.desk", "a")
    waiting.leave("viewer.desk", "forged 0")
    assert not waiting.refusal("viewer.desk", "another")


def ask(client: Bus, key: str, question: Message, answers: Answers) -> None:
    client.ask(key, type(question).__name__, encode(question), 20.0, answers.append, key == DEVICE_STOP.key)


def dropped(server: Node, key: str) -> int:
    return sum(each.dropped for each in server.statistics() if each.key == key)


def test_a_polite_client_gets_all_its_answers(buses: Buses) -> None:
    server, client = buses.node("planner"), buses.open()
    server.serve(PLAN, lambda request: PlanResponse())
    assert client.wait_served(PLAN.key, 1.0)
    answers: Answers = []
    with spinning(server):
        for sent in range(50, 501, 50):  # as much as is permitted at once
            for _ in range(50):
                ask(client, PLAN.key, PlanRequest(), answers)
            assert until(lambda sent=sent: len(answers) == sent, 60.0)
    assert all(answer is not None and answer.ok for answer in answers)
    assert dropped(server, PLAN.key) == 0


def limited(buses: Buses, name: str, of_a_client: Rate = OF_A_CLIENT, of_refusals: Rate = OF_REFUSALS) -> Node:
    """A node with these limits in place of its own."""
    return buses.node(name, rates=RequestRates(of_a_client, of_refusals))


def test_what_a_client_asks_above_its_rate_is_dropped_counted_and_said_once(
    buses: Buses, capsys: pytest.CaptureFixture[str]
) -> None:
    server, flooder, client = limited(buses, "planner", Rate(0.0, 10)), buses.open(), buses.open()
    server.serve(PLAN, lambda request: PlanResponse())
    assert flooder.wait_served(PLAN.key, 1.0)
    assert client.wait_served(PLAN.key, 1.0)
    flood, answers = Answers(), Answers()
    for _ in range(30):
        ask(flooder, PLAN.key, PlanRequest(), flood)
    assert until(lambda: len(flood) == 20)
    ask(client, PLAN.key, PlanRequest(), answers)
    with spinning(server):
        assert until(lambda: len(flood) == 30 and len(answers) == 1)
    assert flood[:20] == [UNREAD] * 20
    assert all(answer is not None and answer.ok for answer in flood[20:] + answers)
    assert dropped(server, PLAN.key) == 20
    assert capsys.readouterr().err.count("of one client, or of newcomers (local): nothing of it is read until") == 1


def test_a_caller_above_the_rate_hears_at_once_of_how_much_is_taken(buses: Buses) -> None:
    server, client = limited(buses, "planner", Rate(0.0, 0)), buses.node("script")
    server.serve(PLAN, lambda request: PlanResponse())
    with pytest.raises(
        NoAnswer, match=r"plan: it has just ended .* or dropped it unread: it takes 500 requests a second of one client"
    ):
        client.call(PLAN, PlanRequest(), timeout=60.0)


def test_a_goal_that_is_dropped_is_sent_again_a_few_times_only(buses: Buses) -> None:
    server, client = limited(buses, "gateway", Rate(0.0, 0)), buses.node("script")
    server.serve_action(FOLLOW_JOINT_TRAJECTORY, lambda goal_id, goal: accept(), lambda goal_id: None)
    with pytest.raises(NoAnswer, match=r"follow_joint_trajectory/result: it has just ended .* dropped it unread"):
        client.action(FOLLOW_JOINT_TRAJECTORY).send(FollowJointTrajectoryGoal(), timeout=2.0)
    assert 1 < dropped(server, f"{FOLLOW_JOINT_TRAJECTORY.key}/result") <= 2.0 / PAUSE + 1


def test_no_more_is_said_of_what_is_refused_than_the_rate(buses: Buses) -> None:
    server, client = limited(buses, "planner", of_refusals=Rate(0.0, 5)), buses.open()
    server.serve(PLAN, lambda request: PlanResponse())
    assert client.wait_served(PLAN.key, 1.0)
    answers = Answers()
    for _ in range(MAX_WAITING_OF_A_CLIENT + 30):
        ask(client, PLAN.key, PlanRequest(), answers)
    assert until(lambda: len(answers) == 30)
    assert answers.count(UNREAD) == 25
    assert dropped(server, PLAN.key) == 30


def test_a_stop_above_the_rate_is_carried_out(buses: Buses) -> None:
    server, client = limited(buses, "gateway", Rate(0.0, 3)), buses.open()
    handled: list[StopKind] = []
    server.serve(DEVICE_STOP, lambda request: handled.append(request.kind) or DeviceCommandResponse(accepted=True))
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers = Answers()
    for _ in range(20):
        ask(client, DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.HOLD), answers)
    ask(client, DEVICE_STOP.key, DeviceStopRequest(), answers)
    assert until(lambda: len(answers) == 18)
    assert hear(server, lambda: len(answers) == 21 and len(handled) == 2)
    assert handled == [StopKind.STOP, StopKind.HOLD]
    assert answers.count(UNREAD) == 18


def test_a_client_that_floods_hears_that_its_stop_was_carried_out(buses: Buses) -> None:
    server, client = limited(buses, "gateway", Rate(0.0, 3)), buses.open()
    server.serve(PLAN, lambda request: PlanResponse())
    server.serve(DEVICE_STOP, lambda request: DeviceCommandResponse(accepted=True))
    assert client.wait_served(PLAN.key, 1.0)
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    flood, answers = Answers(), Answers()
    for _ in range(20):
        ask(client, PLAN.key, PlanRequest(), flood)
    assert until(lambda: len(flood) == 17)
    ask(client, DEVICE_STOP.key, DeviceStopRequest(), answers)
    with spinning(server):
        assert until(lambda: len(answers) == 1)
    assert answers[0] is not None
    assert decode(DeviceCommandResponse, answers[0].payload).accepted


def test_a_caller_whose_stops_are_too_many_hears_that_they_are_carried_out(buses: Buses) -> None:
    server, client = limited(buses, "gateway", Rate(0.0, 0)), buses.node("script")
    handled: list[StopKind] = []
    server.serve(DEVICE_STOP, lambda request: handled.append(request.kind) or DeviceCommandResponse(accepted=True))
    with spinning(server):
        with pytest.raises(
            NoAnswer, match=r"within 0.3 s, sent [3-9] times: it is alive, and carries out what arrives"
        ):
            client.call(DEVICE_STOP, DeviceStopRequest(), timeout=0.3)
        assert until(lambda: handled)
        assert set(handled) == {StopKind.STOP}


def test_a_flood_of_equal_stops_leaves_the_loop_free_between_two_of_them(buses: Buses) -> None:
    server, flooder, client = limited(buses, "gateway", Rate(0.0, 1)), buses.open(), buses.open()
    handled: list[StopKind] = []
    server.serve(DEVICE_STOP, lambda request: handled.append(request.kind) or DeviceCommandResponse(accepted=True))
    assert flooder.wait_served(DEVICE_STOP.key, 1.0)
    assert client.wait_served(DEVICE_STOP.key, 1.0)
    answers, flood = Answers(), Answers()
    with spinning(server):
        began = time.monotonic()
        while len(flood) < 2000:
            ask(flooder, DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.HOLD), flood)
        ask(client, DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.HOLD), answers)
        assert until(lambda: len(answers) == 1)
        most = (time.monotonic() - began) / REPEAT + 3
    assert answers[0] is not None
    assert answers[0].ok
    assert len(handled) <= most


def test_the_last_stop_of_a_flood_is_carried_out(buses: Buses) -> None:
    server, flooder = limited(buses, "gateway", Rate(0.0, 1)), buses.open()
    handled: list[float] = []
    server.serve(DEVICE_STOP, lambda _: handled.append(time.monotonic()) or DeviceCommandResponse(accepted=True))
    assert flooder.wait_served(DEVICE_STOP.key, 1.0)
    flood = Answers()
    with spinning(server):
        for _ in range(500):
            ask(flooder, DEVICE_STOP.key, DeviceStopRequest(), flood)
            last = time.monotonic()
        assert until(lambda: handled and handled[-1] >= last)


def test_a_key_whose_requests_nobody_takes_delays_no_other(
    router: RouterProcess, request: pytest.FixtureRequest
) -> None:
    server, client = (ZenohBus(router.deployment.router, "rm1", Pace(Rate(1e9, 1))) for _ in range(2))
    request.addfinalizer(client.close)
    request.addfinalizer(server.close)
    is_over = threading.Event()
    request.addfinalizer(is_over.set)
    server.serve("slow", lambda query: is_over.wait(30.0))
    server.serve("fast", lambda query: query.reply("BusReply", b""))
    assert client.wait_served("slow", 1.0)
    assert client.wait_served("fast", 1.0)
    for _ in range(3000):
        client.ask("slow", "Question", b"", 30.0, lambda answer: None)
    answers = Answers()
    client.ask("fast", "Question", b"", 5.0, answers.append)
    assert until(lambda: len(answers) == 1, 6.0)
    assert answers == [BusReply(True, "BusReply", b"")]


def test_every_urgent_request_arrives_however_slowly_they_are_taken(
    router: RouterProcess, request: pytest.FixtureRequest
) -> None:
    server, client = (ZenohBus(router.deployment.router, "rm1", Pace(Rate(1e9, 1))) for _ in range(2))
    request.addfinalizer(client.close)
    request.addfinalizer(server.close)
    may_go_on = threading.Event()
    request.addfinalizer(may_go_on.set)
    taken: list[str] = []
    server.serve("stop", lambda query: (may_go_on.wait(30.0), taken.append(query.client), query.drop()), urgent=True)
    assert client.wait_served("stop", 1.0)
    for _ in range(2 * QUERIES):
        client.ask("stop", "Question", b"", 30.0, lambda answer: None)
    may_go_on.set()
    assert until(lambda: len(taken) == 2 * QUERIES, 20.0)


def test_a_request_that_waits_for_its_answer_costs_no_thread(
    router: RouterProcess, request: pytest.FixtureRequest
) -> None:
    server, client = (ZenohBus(router.deployment.router, "rm1") for _ in range(2))
    request.addfinalizer(client.close)
    request.addfinalizer(server.close)
    kept: list[Query] = []
    server.serve("plan", kept.append)
    assert client.wait_served("plan", 1.0)
    before = len(list(Path("/proc/self/task").iterdir()))
    for _ in range(100):
        client.ask("plan", "Question", b"", 30.0, lambda answer: None)
    assert until(lambda: len(kept) == 100)
    assert len(list(Path("/proc/self/task").iterdir())) <= before + 10


class SlowName(str):
    """A client whose thread loses the processor in the midst of being counted, until `goes_on`."""

    is_counted, goes_on = threading.Event(), threading.Event()

    def __hash__(self) -> int:
        self.is_counted.set()
        self.goes_on.wait(60.0)
        return super().__hash__()


def test_a_stop_waits_for_no_thread_that_counts_other_requests() -> None:
    rates, is_permitted = RequestRates(), threading.Event()

    def stop() -> None:
        if rates.permit_request("local", "person", urgent=True):
            is_permitted.set()

    threads = [
        threading.Thread(target=lambda: rates.permit_request("local", SlowName("flooder"))),
        threading.Thread(target=stop),
    ]
    try:
        threads[0].start()
        assert SlowName.is_counted.wait(60.0)
        threads[1].start()
        assert is_permitted.wait(10.0)
    finally:
        SlowName.goes_on.set()
        for thread in threads:
            thread.join(60.0)
