"""The MQTT link against real brokers, with the virtual ESP32 as its own process at the other end."""

from __future__ import annotations

import os
import time
from contextlib import closing

from paho.mqtt import publish

from schemas.actions import GoalStatusCode
from schemas.motion import FollowErrorCode
from services.stepper_gateway.links.link import Kind
from services.stepper_gateway.links.mqtt import MqttLink
from tests.stepper_gateway.processes import BROKER, DEVICE, Processes, free_port
from tests.stepper_gateway.wired import Gateway

HOME = (0.0, 0.0, 0.0)
NEAR = (0.1, -0.2, 0.01)


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
