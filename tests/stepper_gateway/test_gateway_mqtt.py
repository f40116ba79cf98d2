"""The MQTT link against real brokers, with the virtual ESP32 as its own process at the other end."""

from __future__ import annotations

import json
import os
import signal
import time
from contextlib import closing

import pytest
from msgspec.structs import replace
from paho.mqtt import publish
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import ArmCommand, DeviceCommandKind, DeviceStatus, ReferenceCommand, StopKind
from gemelo.schemas.device_config import config_crc, config_text
from gemelo.schemas.motion import FollowErrorCode
from gemelo.services.stepper_gateway.links.frames import Chunk, CommandFrame, decode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from gemelo.tools.virtual_arm.virtual_arm import rm1
from tests.stepper_gateway.processes import BROKER, DEVICE, Processes, free_port
from tests.stepper_gateway.wired import WiredGateway, plain

HOME = (0.0, 0.0, 0.0)
NEAR = (0.1, -0.2, 0.01)


def test_a_move_over_a_real_broker_and_what_strangers_publish_moves_nothing(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.move_to(NEAR).accepted
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
        assert gateway.published["joint_states"][-1].position == gateway.core.device.reporter.positions(steps)
        assert gateway.move_to(HOME, "back").accepted
        assert gateway.finish("back")[0] == GoalStatusCode.SUCCEEDED
        trips = sorted(ack.round_trip for ack in gateway.published["command_acks"])
        assert trips[len(trips) // 2] < 0.05


def test_a_killed_broker_aborts_the_goal_and_nothing_stale_is_sent_after_it_returns(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.move_to((1.0, -1.0, 0.1)).accepted
        gateway.run(1.0)
        processes.kill(BROKER)
        status, result = gateway.finish()
        assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED)
        assert not gateway.link.send(Kind.TRAJ, b"stale")
        assert str(processes.port) in str(gateway.link.reason)
        gateway.run(1.0)
        processes.start_broker()
        gateway.ready()
        gateway.run(2.0)
        refused = gateway.published["device/state"][-1].refused
        assert gateway.move_to(NEAR, "next").accepted
        assert gateway.finish("next")[0] == GoalStatusCode.SUCCEEDED
        assert gateway.published["device/state"][-1].refused == refused


@pytest.mark.full
def test_a_stop_to_a_frozen_broker_is_answered_in_time_and_is_carried_out_when_it_thaws(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway, closing(Wire(processes.port)) as wire:
        gateway.ready()
        assert gateway.move_to((1.0, -1.0, 0.1)).accepted
        gateway.run(1.0)
        processes.signal(BROKER, signal.SIGSTOP)
        sent_before = len(wire.frames)
        began = time.monotonic()
        answer = gateway.answer(StopKind.STOP)
        took = time.monotonic() - began
        processes.signal(BROKER, signal.SIGCONT)
        assert took < gateway.core.device.parameters.command_timeout + 2.0
        assert not answer.accepted
        assert answer.sent
        assert "has not answered STOP in time" in answer.reason
        assert gateway.finish()[0] == GoalStatusCode.ABORTED
        gateway.ready()
        late = [decode(frame) for frame in wire.frames[sent_before:]]
        commands = [frame for frame in late if isinstance(frame, CommandFrame)]
        assert commands[0].cmd == DeviceCommandKind.STOP
        assert not [frame for frame in late[late.index(commands[0]) :] if isinstance(frame, Chunk)]
        states = gateway.published["joint_states"]
        thawed = time.time_ns()
        assert gateway.run(10.0, lambda: states[-1].stamp > thawed)  # not one that has waited in the broker
        stood = states[-1].position
        gateway.run(1.0)
        assert states[-1].position == stood
        assert gateway.move_to(NEAR, "next").accepted
        assert gateway.finish("next")[0] == GoalStatusCode.SUCCEEDED


class Wire:
    """The trajectory and command frames on the wire, in their order."""

    def __init__(self, port: int) -> None:
        self.frames: list[bytes] = []
        self._client = Client(CallbackAPIVersion.VERSION2)
        self._client.on_message = lambda client, data, message: self.frames.append(message.payload)
        self._client.connect("127.0.0.1", port)
        self._client.subscribe([(f"gemelo/v1/rm1/{kind}", 0) for kind in (Kind.TRAJ, Kind.CMD)])
        self._client.loop_start()

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


@pytest.mark.full
def test_a_restarted_device_is_met_again(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        boot = gateway.core.device.session.boot_id
        processes.kill(DEVICE)
        assert gateway.run(3.0, lambda: bool(gateway.core.not_ready(gateway.moment)))
        processes.start(DEVICE)
        gateway.ready()
        assert gateway.core.device.session.boot_id != boot
        assert gateway.move_to(NEAR).accepted
        assert gateway.finish()[0] == GoalStatusCode.SUCCEEDED


def test_a_link_without_a_broker_says_so_and_costs_nothing() -> None:
    port = free_port()
    with closing(MqttLink(plain(port), "rm1", lambda: None)) as link:
        time.sleep(0.3)
        before = time.process_time()
        time.sleep(0.7)
        assert time.process_time() - before < 0.1
        assert not link.connected
        assert str(port) in str(link.reason)
        assert "broker" in str(link.reason)
        assert not link.send(Kind.HB, b"")


def said(gateway: WiredGateway) -> DeviceStatus:
    status: DeviceStatus = gateway.published["device/status"][-1]
    return status


@pytest.mark.full
def test_a_dead_device_is_said_dead_to_every_gateway_that_comes_after(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        assert said(gateway).online
        processes.kill(DEVICE)
        assert gateway.run(3.0, lambda: not said(gateway).online)
        assert gateway.run(10.0, lambda: "offline" in said(gateway).reason), "its last will has come"
    with closing(WiredGateway(processes.port)) as late:
        late.run(1.5)
        assert not said(late).online
        assert said(late).boot_id == 0
        assert not late.published["joint_states"]
        assert late.core.not_ready(late.moment)


@pytest.mark.full
def test_a_retained_status_of_long_ago_is_no_sign_of_life(processes: Processes) -> None:
    processes.kill(DEVICE)
    time.sleep(0.5)
    alive: dict[str, object] = {
        "online": True,
        "device": "rm1",
        "boot_id": 5,
        "joints": 3,
        "armed": True,
        "referenced": True,
    }
    alive["config_crc32"] = config_crc(config_text(device_config(rm1())))
    publish.single(
        "gemelo/v1/rm1/status", json.dumps(alive), qos=1, retain=True, hostname="127.0.0.1", port=processes.port
    )
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.run(1.0)
        assert not said(gateway).online
        assert "silent" in said(gateway).reason
        processes.start(DEVICE)
        gateway.ready()
        assert said(gateway).online
        assert said(gateway).boot_id not in (0, 5)


@pytest.mark.full
def test_a_retained_configuration_of_another_robot_is_replaced_and_nothing_moves_by_it(processes: Processes) -> None:
    wanted = device_config(rm1())
    stale = replace(wanted, joints=(replace(wanted.joints[0], max_velocity_q8=400_000), *wanted.joints[1:]))
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.answer(StopKind.DISARM, seconds=8.0).accepted
        publish.single(
            "gemelo/v1/rm1/config", config_text(stale), qos=1, retain=True, hostname="127.0.0.1", port=processes.port
        )
        taken = ["configured", "configured"]  # the stale one, then ours
        assert gateway.run(
            5.0, lambda: [e.event for e in gateway.published["device/events"] if e.event in taken] == taken
        )
        assert gateway.run(5.0, lambda: said(gateway).config_crc32 == config_crc(config_text(wanted)))
        assert gateway.run(5.0, lambda: gateway.published["device/configuration"][-1].accepted)
        for kind in (ArmCommand(), ReferenceCommand()):
            gateway.run(0.4)
            assert gateway.answer(kind, seconds=8.0).accepted
        gateway.run(0.4)
        assert gateway.move_to(NEAR).accepted
        assert gateway.finish()[0] == GoalStatusCode.SUCCEEDED
    processes.kill(DEVICE)
    processes.start(DEVICE)  # it meets what the broker has retained now
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        gateway.run(0.5)
        assert gateway.published["device/configuration"][-1].accepted


@pytest.mark.full
def test_a_gateway_gives_the_configuration_when_it_is_asked_for(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.configure().accepted, "the one it has already"
