"""Gateway and virtual device on a mosquitto with TLS, users and an ACL: moved end to end, lost and met again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import psutil
import pytest

from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import BrokerAccess, gateway_access
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.deployment import Wire
from gemelo.schemas.motion import FollowErrorCode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from tests.stepper_gateway.harness import ROOT
from tests.stepper_gateway.locked import wait_for
from tests.stepper_gateway.processes import BROKER, DEVICE, Processes
from tests.stepper_gateway.wired import WiredGateway

pytestmark = pytest.mark.full

NEAR = (0.1, -0.2, 0.01)


@pytest.fixture
def lock(tmp_path: Path) -> Path:
    """A secure folder, by the command that a person uses."""
    folder = tmp_path / "lock"
    secured(folder)
    return folder


def secured(folder: Path, *words: str, port: int = 8883) -> str:
    command = [sys.executable, "-m", "gemelo.tools.cli.main", "broker", "secure", "--folder", str(folder), *words]
    command += ["--host", "127.0.0.1", "--device", "rm1", "--port", str(port)]
    environment = {**os.environ, "GEMELO_WIFI_PASSWORD": "correct horse"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.fixture
def processes(tmp_path: Path, lock: Path) -> Iterator[Processes]:
    with closing(Processes("mosquitto", tmp_path, secure_folder=str(lock))) as found:
        found.start_broker()
        yield found


def gateway_on(access: BrokerAccess) -> WiredGateway:
    return WiredGateway(link=lambda wake: MqttLink(access, "rm1", wake))


def secrets_of(lock: Path) -> list[str]:
    return [secure_folder.password_of(lock, user) for user in ("gateway", "rm1")]


def command_lines(processes: Processes) -> str:
    """Of the processes and what they have started, as every user of the machine sees them."""
    parents = [psutil.Process(pid) for pid in processes.pids]
    return "\n".join(" ".join(each.cmdline()) for parent in parents for each in [parent, *parent.children(True)])


def test_an_arm_moves_over_tls_and_a_broker_that_vanishes_and_returns_moves_nothing(
    processes: Processes, lock: Path
) -> None:
    processes.start(DEVICE)
    with closing(gateway_on(gateway_access(processes.deployment.mqtt))) as gateway:
        gateway.ready()
        assert gateway.move_to((1.0, -1.0, 0.1)).accepted
        gateway.run(1.0)
        processes.kill(BROKER)
        status, result = gateway.finish()
        assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED)
        assert not gateway.link.send(Kind.TRAJ, b"stale")
        gateway.run(0.7)
        processes.start_broker()
        gateway.ready()
        stood = gateway.published["joint_states"][-1].position
        gateway.run(1.0)
        assert gateway.published["joint_states"][-1].position == stood
        assert gateway.move_to(NEAR, "next").accepted
        assert gateway.finish("next")[0] == GoalStatusCode.SUCCEEDED
    for secret in secrets_of(lock):
        assert secret not in processes.log + command_lines(processes)


def test_a_board_that_is_provisioned_for_mqtts_joins_the_locked_broker_and_moves(
    processes: Processes, lock: Path, tmp_path: Path
) -> None:
    """The path of firmware/README.md: the device knows nothing of the deployment's broker, only what it is told."""
    elsewhere = {"GEMELO_MQTT_SECURE_FOLDER": "", "GEMELO_MQTT_PORT": "1", "GEMELO_WIRE": Wire.MQTT.value}
    processes.start(DEVICE, "--serial", environment=elsewhere)
    line = Path(processes.deployment.paths.run, "virtual_esp32.tty")
    wait_for(line.exists)
    said = secured(lock, "--serial", str(line), "--wifi-ssid", "lab", port=processes.port)
    assert f"taken: device rm1, wifi_ssid lab, mqtt_uri mqtts://127.0.0.1:{processes.port}, mqtt_user rm1" in said
    assert "mqtt_password given" in said
    with closing(gateway_on(gateway_access(processes.deployment.mqtt))) as gateway:
        gateway.ready()
        assert gateway.move_to(NEAR).accepted
        assert gateway.finish()[0] == GoalStatusCode.SUCCEEDED
    for secret in secrets_of(lock):
        assert secret not in said + processes.log + command_lines(processes)


def test_an_acl_that_lets_no_chunk_through_aborts_the_goal_with_its_sentence_and_the_arm_stands(
    processes: Processes, lock: Path
) -> None:
    processes.kill(BROKER)
    acl = lock / "acl"
    acl.write_text(acl.read_text().replace("topic write gemelo/v1/+/traj\n", ""))
    processes.start_broker()
    processes.start(DEVICE)
    with closing(gateway_on(gateway_access(processes.deployment.mqtt))) as gateway:
        gateway.ready()
        stood = gateway.published["joint_states"][-1].position
        assert gateway.move_to(NEAR).accepted
        status, result = gateway.finish()
        assert status == GoalStatusCode.ABORTED
        assert "write gemelo/v1/rm1/traj: its ACL must allow it" in result.error_string
        gateway.ready()
        gateway.run(0.5)
        assert gateway.published["joint_states"][-1].position == stood


def test_a_device_that_may_not_write_says_so_once_and_the_gateway_asks_about_the_acl(
    processes: Processes, lock: Path
) -> None:
    processes.kill(BROKER)
    acl = lock / "acl"
    kept = [line for line in acl.read_text().splitlines() if "write gemelo/v1/rm1/" not in line or "/status" in line]
    acl.write_text("\n".join(kept) + "\n")
    processes.start_broker()
    processes.start(DEVICE)
    with closing(gateway_on(gateway_access(processes.deployment.mqtt))) as gateway:
        denied = 'does not let user "rm1" write gemelo/v1/rm1/state: its ACL must allow it'
        assert gateway.run(10.0, lambda: denied in processes.log)
        gateway.run(0.5)
        assert processes.log.count(denied) == 1
        reason = gateway.core.not_ready(gateway.moment)
        assert reason is not None
        assert reason.code in ("device.silent", "device.never_received")
