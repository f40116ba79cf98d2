"""The bridge as a process: killed and started again, beside a ROS peer that is frozen, and without a router."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DESCRIPTION, JOINT_STATES
from gemelo.services.state_publisher.main import describe
from tests.ros_bridge.ros_client import RosClient, comes, ros_router
from tests.runtime.support import ROOT, RouterProcess, free_port, until

pytestmark = pytest.mark.full

JOINTS = "sensor_msgs/msg/JointState"
FROZEN = """
import json, sys, time, zenoh
config = {{"mode": "client", "connect": {{"endpoints": [{locator!r}]}},
           "scouting": {{"multicast": {{"enabled": False}}}}}}
session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
heard = session.declare_subscriber({key!r}, lambda sample: print("heard", flush=True))
time.sleep(300)
"""


class Site(NamedTuple):
    """Our router with a gateway and a state publisher that only speak, and the router of ROS."""

    router: RouterProcess
    locator: str
    client: RosClient

    def start(self) -> subprocess.Popen[str]:
        """The bridge, as a user starts it."""
        environ = self.router.environ | {"GEMELO_ROS_ROUTER": self.locator, "GEMELO_ROBOT": "urdf/rm1"}
        command = [sys.executable, "-m", "gemelo.services.ros_bridge.main"]
        return subprocess.Popen(command, cwd=ROOT, env=environ, stderr=subprocess.PIPE, text=True)

    def is_there(self) -> bool:
        return any("set_parameters_atomically" in each for each in self.client.tokens())


@pytest.fixture
def site(tmp_path: Path, rm1: ArmDescription) -> Iterator[Site]:
    router = RouterProcess(tmp_path)
    try:
        with (
            ros_router() as locator,
            RosClient(locator) as client,
            Node("state_publisher", router.deployment, robot="rm1", stop=ShutdownRequest()) as publisher,
            speaking(router),
        ):
            publisher.publisher(DESCRIPTION).put(describe(rm1))
            yield Site(router, locator, client)
    finally:
        router.kill()


@contextmanager
def speaking(router: RouterProcess) -> Iterator[None]:
    """A gateway that publishes joint states 50 times a second."""
    with Node("stepper_gateway", router.deployment, robot="rm1", stop=ShutdownRequest()) as gateway:
        states = gateway.publisher(JOINT_STATES)
        spin = lambda: gateway.spin(lambda now: states.put(JointState(stamp=now, name=("a",), position=(0.0,))), 50.0)  # noqa: E731
        thread = threading.Thread(target=spin)
        thread.start()
        try:
            yield
        finally:
            gateway.stop()
            thread.join(60.0)


def end(process: subprocess.Popen[str], how: signal.Signals = signal.SIGTERM) -> tuple[int, str]:
    process.send_signal(signal.SIGCONT)
    process.send_signal(how)
    _, said = process.communicate(timeout=60.0)
    return process.returncode, said


def test_a_bridge_that_is_killed_is_gone_and_the_next_one_reaches_who_was_there(
    site: Site, rm1: ArmDescription
) -> None:
    first = site.start()
    assert until(site.is_there)
    described = site.client.subscribe("/robot_description", "std_msgs/msg/String", latched=True)
    states = site.client.subscribe("/joint_states", JOINTS)
    comes(described)
    comes(states, 10)
    end(first, signal.SIGKILL)
    assert until(lambda: not site.client.tokens())
    before = len(states)
    second = site.start()
    try:
        assert until(site.is_there)
        comes(states, before + 10)
        comes(described, 2)
        with RosClient(site.locator) as late:
            comes(late.subscribe("/robot_description", "std_msgs/msg/String", latched=True))
    finally:
        code, said = end(second)
    assert code == 0, said


def test_a_frozen_subscriber_of_ros_disturbs_nobody(site: Site) -> None:
    bridge = site.start()
    try:
        assert until(site.is_there)
        key = next(each for each in site.client.tokens() if "%joint_states" in each).split("/")
        program = FROZEN.format(locator=site.locator, key=f"0/joint_states/{key[10]}/{key[11]}")
        reader = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
        assert reader.stdout is not None
        assert reader.stdout.readline() == "heard\n"
        os.kill(reader.pid, signal.SIGSTOP)
        states = site.client.subscribe("/joint_states", JOINTS)
        comes(states, 400)
        numbers = [each.attachment.sequence for each in states]
        assert numbers[-1] - numbers[0] < 1.1 * len(numbers)  # of those that were sent meanwhile hardly any is lost
        end(reader, signal.SIGKILL)
    finally:
        code, said = end(bridge)
    assert code == 0, said


def test_without_a_router_of_ros_it_ends_with_one_sentence(site: Site) -> None:
    alone = site._replace(locator=f"tcp/127.0.0.1:{free_port()}").start()
    _, said = alone.communicate(timeout=60.0)
    assert alone.returncode == 1
    assert "does not take the session" in said
    assert "Traceback" not in said
