"""The MQTT link against real brokers, with the virtual ESP32 as its own process at the other end."""

from __future__ import annotations

import os
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from typing import Any

from paho.mqtt import publish

from schemas.actions import GoalStatusCode
from schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from services.stepper_gateway.core import GatewayCore
from services.stepper_gateway.links.link import Kind
from services.stepper_gateway.links.mqtt import MqttLink
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.outputs import GoalFinished, Output, Publish, SendFrame
from tests.stepper_gateway.harness import move, rm1
from tests.stepper_gateway.processes import BROKER, DEVICE, Processes, free_port

HOME = (0.0, 0.0, 0.0)
NEAR = (0.1, -0.2, 0.01)


class Gateway:
    """Core and MQTT link with a small loop of their own, without the bus."""

    def __init__(self, port: int) -> None:
        self.core = GatewayCore(rm1(), int.from_bytes(os.urandom(3), "little") + 1)
        self.published: dict[str, list[Any]] = defaultdict(list)
        self.finished: dict[str, tuple[GoalStatusCode, FollowJointTrajectoryResult]] = {}
        self._woken = threading.Event()
        self.link = MqttLink("127.0.0.1", port, "rm1", self._woken.set)

    def close(self) -> None:
        self.link.close()

    @property
    def moment(self) -> Moment:
        return Moment(time.time_ns(), time.monotonic())

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        end = time.monotonic() + seconds
        due = 0.0
        while time.monotonic() < end:
            if until():
                return True
            if time.monotonic() >= due:
                due = time.monotonic() + 0.02
                self.do(self.core.step(self.moment))
            self._woken.wait(max(0.0, due - time.monotonic()))
            self._woken.clear()
            self.do(self.core.on_link(self.link.connected, self.link.reason, self.moment))
            for received in self.link.take(64):
                self.do(self.core.on_received(received, self.moment))
        return until()

    def ready(self) -> None:
        assert self.run(15.0, lambda: not self.core.not_ready(self.moment)), self.core.not_ready(self.moment)
        self.run(0.1)

    def goal(self, end: tuple[float, ...], goal_id: str = "g") -> Any:
        here = self.published["joint_states"][-1].position
        verdict, outputs = self.core.on_goal(
            goal_id, FollowJointTrajectoryGoal(trajectory=move(here, end)), self.moment
        )
        self.do(outputs)
        return verdict

    def finish(self, goal_id: str = "g") -> tuple[GoalStatusCode, FollowJointTrajectoryResult]:
        assert self.run(20.0, lambda: goal_id in self.finished)
        return self.finished[goal_id]

    def do(self, outputs: list[Output]) -> None:
        for output in outputs:
            match output:
                case SendFrame(kind, payload):
                    self.link.send(kind, payload)
                case Publish(topic, message):
                    self.published[topic.key].append(message)
                case GoalFinished(goal_id, status, result):
                    self.finished[goal_id] = (status, result)
                case _:
                    pass


def test_a_move_over_a_real_broker_and_what_strangers_publish_moves_nothing(processes: Processes) -> None:
    with closing(Gateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.goal(NEAR).accepted
        assert gateway.finish()[0] == GoalStatusCode.SUCCEEDED
        steps = gateway.finished["g"][1].executed_steps
        for topic in ("state", "traj/ack", "event", "cmd/ack", "sync/r", "traj", "cmd", "hb", "sync"):
            publish.multiple(
                [
                    (f"gemelo/v1/rm1/{topic}", b"\x67\x01garbage", 1, False),
                    (f"gemelo/v1/rm1/{topic}", os.urandom(100_000), 1, False),
                ],
                hostname="127.0.0.1",
                port=processes.port,
            )
        gateway.run(0.5)
        assert gateway.core.bad_frames >= 10
        assert gateway.published["joint_states"][-1].position == gateway.core.mover.reporter.positions(steps)
        assert gateway.goal(HOME, "back").accepted
        assert gateway.finish("back")[0] == GoalStatusCode.SUCCEEDED
        trips = sorted(ack.round_trip for ack in gateway.published["command_acks"])
        assert trips[len(trips) // 2] < 0.05


def test_a_killed_broker_aborts_the_goal_and_nothing_stale_is_sent_after_it_returns(processes: Processes) -> None:
    with closing(Gateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.goal((1.0, -1.0, 0.1)).accepted
        gateway.run(1.0)
        processes.kill(BROKER)
        status, result = gateway.finish()
        assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED)
        assert not gateway.link.send(Kind.TRAJ, b"stale")
        assert str(processes.port) in gateway.link.reason
        gateway.run(1.0)
        processes.start_broker()
        gateway.ready()
        gateway.run(2.0)
        refused = gateway.published["device/state"][-1].refused
        assert gateway.goal(NEAR, "next").accepted
        assert gateway.finish("next")[0] == GoalStatusCode.SUCCEEDED
        assert gateway.published["device/state"][-1].refused == refused


def test_a_restarted_device_is_met_again(processes: Processes) -> None:
    with closing(Gateway(processes.port)) as gateway:
        gateway.ready()
        boot = gateway.core.mover.session.boot_id
        processes.kill(DEVICE)
        assert gateway.run(3.0, lambda: bool(gateway.core.not_ready(gateway.moment)))
        processes.start(DEVICE)
        gateway.ready()
        assert gateway.core.mover.session.boot_id != boot
        assert gateway.goal(NEAR).accepted
        assert gateway.finish()[0] == GoalStatusCode.SUCCEEDED


def test_a_link_without_a_broker_says_so_and_costs_nothing() -> None:
    port = free_port()
    with closing(MqttLink("127.0.0.1", port, "rm1", lambda: None)) as link:
        time.sleep(0.3)
        before = time.process_time()
        time.sleep(0.7)
        assert time.process_time() - before < 0.1
        assert not link.connected
        assert str(port) in link.reason
        assert "broker" in link.reason
        assert not link.send(Kind.HB, b"")
