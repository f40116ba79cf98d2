"""kill -9 of the router and its return: everything that was declared works again, nothing of EVERY is lost."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.client_watch import RETURN
from gemelo.libraries.runtime.errors import BusError, NoAnswer, ServerLost
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlanCode, PlanRequest, PlanResponse
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import DESCRIPTION, FOLLOW_JOINT_TRAJECTORY, JOINT_STATES, LOG, PLAN, Delivery
from tests.runtime.support import RouterProcess, hear, spinning, until
from tests.runtime.test_actions import Arm, goal_of

RECOVERY = 8.0  # [s]


@pytest.fixture
def own_router(tmp_path: Path) -> Iterator[RouterProcess]:
    process = RouterProcess(tmp_path)
    yield process
    process.kill()


def open_node(router: RouterProcess, name: str) -> Node:
    return Node(name, router.deployment, robot="rm1")


def test_everything_works_again_after_the_router_was_killed(own_router: RouterProcess) -> None:
    with open_node(own_router, "state_publisher") as writer, open_node(own_router, "client") as client:
        heard: list[int] = []
        states = client.latest(JOINT_STATES)
        client.subscribe(LOG, lambda record: heard.append(record.stamp))
        descriptions: list[str] = []
        client.subscribe(DESCRIPTION, lambda message: descriptions.append(message.urdf))
        writer.serve(PLAN, lambda request: PlanResponse(code=PlanCode.SUCCESS))
        log, description = writer.publisher(LOG), writer.publisher(DESCRIPTION)
        log.put(LogRecord(stamp=1))
        with spinning(writer), spinning(client):
            assert client.call(PLAN, PlanRequest()).code is PlanCode.SUCCESS
            router = client.router
            own_router.kill()
            assert until(lambda: not client.is_connected)
            assert not client.router
            for stamp in range(2, 300):
                log.put(LogRecord(stamp=stamp))
            description.put(RobotDescription(urdf="while away"))
            with pytest.raises(NoAnswer, match="the router is away"):
                client.call(PLAN, PlanRequest(), timeout=0.3)
            own_router.start()
            back = time.monotonic()
            log.put(LogRecord(stamp=300))
            assert client.call(PLAN, PlanRequest(), timeout=RECOVERY).code is PlanCode.SUCCESS
            assert until(lambda: client.alive() == {"state_publisher", "client"}, RECOVERY)
            assert until(lambda: heard == list(range(1, 301)), RECOVERY), heard[-5:]
            assert until(lambda: descriptions == ["while away"], RECOVERY)
            writer.publisher(JOINT_STATES).put(JointState(stamp=9))
            assert until(lambda: states.message == JointState(stamp=9), RECOVERY)
            assert client.router not in ("", router)
            assert time.monotonic() - back < RECOVERY
            with open_node(own_router, "late") as late:
                newest = late.latest(DESCRIPTION)
                assert hear(late, lambda: newest.message)
                assert newest.message == RobotDescription(urdf="while away")


def test_the_result_of_a_goal_comes_when_the_router_is_back(own_router: RouterProcess) -> None:
    with open_node(own_router, "stepper_gateway") as gateway, open_node(own_router, "client") as client:
        arm = Arm(gateway)
        with spinning(gateway, arm.step, rate=100.0):
            handle = client.action(FOLLOW_JOINT_TRAJECTORY).send(goal_of(100))
            own_router.kill()
            assert until(lambda: not arm.left, 3.0), "the motion needs no router"
            time.sleep(1.5)  # longer away than a server may be silent
            client.wait(0.05)
            own_router.start()
            assert handle.wait(RECOVERY + 1.0).status is GoalStatusCode.SUCCEEDED


def test_a_cancel_is_not_lost_with_the_router(own_router: RouterProcess) -> None:
    with open_node(own_router, "stepper_gateway") as gateway, open_node(own_router, "client") as client:
        arm = Arm(gateway)
        with spinning(gateway, arm.step, rate=100.0):
            handle = client.action(FOLLOW_JOINT_TRAJECTORY).send(goal_of(10_000))
            own_router.kill()
            assert until(lambda: not client.is_connected)
            handle.cancel()
            own_router.start()
            assert handle.wait(RECOVERY).status is GoalStatusCode.CANCELED


def test_an_answer_while_the_router_is_away_harms_nobody(own_router: RouterProcess) -> None:
    with open_node(own_router, "planner") as planner, open_node(own_router, "client") as client:
        begun: list[float] = []

        def plan(request: PlanRequest) -> PlanResponse:
            begun.append(time.monotonic())
            time.sleep(request.allowed_time)
            return PlanResponse(code=PlanCode.SUCCESS)

        planner.serve(PLAN, plan)
        with spinning(planner):
            asking = threading.Thread(target=_call_in_vain, args=(client,))
            asking.start()
            assert until(lambda: begun)
            own_router.kill()
            time.sleep(0.5)
            own_router.start()
            asking.join()
            answer = client.call(PLAN, PlanRequest(allowed_time=0.0), timeout=RECOVERY)
            assert answer.code is PlanCode.SUCCESS


def _call_in_vain(client: Node) -> None:
    with pytest.raises(NoAnswer):
        client.call(PLAN, PlanRequest(allowed_time=0.4), timeout=1.0)


def test_a_router_that_stays_away_ends_the_waiting(own_router: RouterProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gemelo.libraries.runtime.actions.goal_handle.ROUTER_TIMEOUT", 1.0)
    with open_node(own_router, "stepper_gateway") as gateway, open_node(own_router, "client") as client:
        arm = Arm(gateway)
        with spinning(gateway, arm.step, rate=100.0):
            handle = client.action(FOLLOW_JOINT_TRAJECTORY).send(goal_of(10_000))
            own_router.kill()
            with pytest.raises(ServerLost, match="the router has been away"):
                handle.wait(60.0)


@pytest.mark.parametrize("frozen", [0.0, 1.5])
def test_a_frozen_router_blocks_a_publisher_for_a_bounded_time(own_router: RouterProcess, frozen: float) -> None:
    with open_node(own_router, "gateway") as gateway, open_node(own_router, "reader") as reader:
        reader.subscribe(LOG, lambda record: None)
        publisher = gateway.publisher(LOG)
        own_router.process.send_signal(signal.SIGSTOP)
        longest = 0.0
        for _ in range(3000):
            begin = time.monotonic()
            publisher.put(LogRecord(text="x" * 8000))
            longest = max(longest, time.monotonic() - begin)
        time.sleep(frozen)
        own_router.process.send_signal(signal.SIGCONT)
        assert longest < 1.0
        assert until(lambda: gateway.is_connected and reader.is_connected, RECOVERY)


def test_a_node_that_does_not_find_back_ends_so_that_it_is_started_anew(
    own_router: RouterProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gemelo.libraries.runtime.bus.zenoh_bus.RECONNECTION_TIMEOUT", 0.5)
    monkeypatch.setattr("gemelo.libraries.runtime.bus.zenoh_bus.ZenohBus.is_connected", False)
    with open_node(own_router, "astray") as node, pytest.raises(BusError, match="did not take this session back"):
        node.spin()


def test_an_attached_goal_outlives_a_router_that_comes_back_and_not_its_client(own_router: RouterProcess) -> None:
    with open_node(own_router, "stepper_gateway") as gateway, open_node(own_router, "client") as client:
        arm = Arm(gateway)
        with spinning(gateway, arm.step, rate=100.0):
            handle = client.action(FOLLOW_JOINT_TRAJECTORY).send(goal_of(9_000), attached=True)
            with spinning(client):
                own_router.kill()
                assert until(lambda: not gateway.is_connected and not client.is_connected)
                own_router.start()
                assert until(lambda: gateway.is_connected and client.is_connected, RECOVERY)
                seen = time.monotonic()
                assert not until(lambda: not arm.left, RETURN + 1.0), f"ended after {time.monotonic() - seen:.2f} s"
                assert handle.status is GoalStatusCode.EXECUTING
            client.close()
            assert until(lambda: not arm.left)


@pytest.mark.parametrize("key", ["@request/plan", "log", "device/events"])
def test_what_is_written_while_the_router_is_away_comes_when_it_is_back(own_router: RouterProcess, key: str) -> None:
    heard: list[bytes] = []
    writer, reader = (ZenohBus(own_router.deployment.router, "rm1") for _ in range(2))
    reader.subscribe(key, Delivery.EVERY, lambda arrival: heard.append(arrival.payload), lambda missed: None)
    publication = writer.publish(key, "Text", Delivery.EVERY, "planner")
    assert until(lambda: publication.put(b"before") or heard)
    own_router.kill()
    assert until(lambda: not writer.is_connected)
    publication.put(b"while it was away")
    own_router.start()
    assert until(lambda: b"while it was away" in heard, RECOVERY)
    writer.close()
    reader.close()
