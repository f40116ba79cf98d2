"""The checks that `make up` runs before it starts a process."""

from __future__ import annotations

import socket
import tempfile
from contextlib import closing
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.mqtt import secure_folder
from gemelo.schemas.deployment import (
    Broker,
    Deployment,
    DeviceKind,
    MqttSection,
    RouterSection,
    ViewerMode,
    ViewerSection,
)
from gemelo.tools.stack.stack import free_ports
from gemelo.tools.stack.start_check import main, start_problems
from tests.arm.bare_arm import write_bare_arm
from tests.optional import need
from tests.stepper_gateway.locked import Mosquitto, external, locked


@pytest.fixture
def free() -> Deployment:
    router, mqtt, grpc, web = free_ports(4)
    return Deployment(
        router=RouterSection(port=router), mqtt=MqttSection(port=mqtt), viewer=ViewerSection(port=grpc, web_port=web)
    )


def problems(deployment: Deployment) -> list[str]:
    return [str(reason) for reason in start_problems(deployment)]


def test_nothing_stands_in_the_way_of_free_ports_and_a_good_arm(free):
    assert problems(free) == []


def test_every_taken_port_is_said_at_once(free):
    with socket.create_server(("127.0.0.1", free.router.port)), socket.create_server(("127.0.0.1", free.viewer.port)):
        router, viewer = problems(free)
    assert "GEMELO_ROUTER_PORT" in router
    assert "GEMELO_VIEWER_PORT" in viewer


def test_ports_of_a_viewer_that_is_not_wanted_do_not_matter(free):
    viewer = msgspec.structs.replace(free.viewer, mode=ViewerMode.NONE)
    with socket.create_server(("127.0.0.1", free.viewer.port)):
        assert problems(msgspec.structs.replace(free, viewer=viewer)) == []


def test_an_arm_that_is_not_there_is_named(free):
    (problem,) = problems(msgspec.structs.replace(free, robot="urdf/nobody"))
    assert "urdf/nobody" in problem


def test_a_broker_that_runs_already_is_asked_itself_and_needs_no_free_port(free):
    strange = msgspec.structs.replace(free.mqtt, broker=Broker.EXTERNAL)
    (problem,) = problems(msgspec.structs.replace(free, mqtt=strange))
    assert f"no MQTT broker answers at 127.0.0.1:{strange.port}" in problem
    need("mosquitto")
    plain = msgspec.structs.replace(strange, broker=Broker.MOSQUITTO)
    with tempfile.TemporaryDirectory() as folder, closing(Mosquitto(Path(folder), plain)):
        assert problems(msgspec.structs.replace(free, mqtt=strange)) == []


def test_a_password_that_others_can_read_or_that_is_wrong_is_said_before_anything_starts(free, tmp_path):
    section = locked(tmp_path / "lock")
    (tmp_path / "lock" / "rm1.password").chmod(0o644)
    (problem,) = problems(msgspec.structs.replace(free, mqtt=section))
    assert f"chmod 600 {tmp_path}/lock/rm1.password" in problem
    secure_folder.write(tmp_path / "wrong", "wrong\n")
    mine = external(section, password_file=str(tmp_path / "wrong"))
    with closing(Mosquitto(tmp_path, section)):
        (problem,) = problems(msgspec.structs.replace(free, mqtt=mine))
    assert 'refuses user "gateway"' in problem


def test_a_lock_that_was_never_made_is_named_with_the_command(free, tmp_path):
    section = msgspec.structs.replace(free.mqtt, broker=Broker.MOSQUITTO, secure_folder=str(tmp_path))
    (problem,) = problems(msgspec.structs.replace(free, mqtt=section))
    assert "ca.pem" in problem or "password" in problem


def test_the_listening_port_is_the_one_that_must_be_free(free):
    (other,) = free_ports(1)
    section = msgspec.structs.replace(free.mqtt, listen_port=other)
    with socket.create_server(("127.0.0.1", free.mqtt.port)):
        assert problems(msgspec.structs.replace(free, mqtt=section)) == []
    with socket.create_server(("127.0.0.1", other)):
        (problem,) = problems(msgspec.structs.replace(free, mqtt=section))
    assert "GEMELO_MQTT_LISTEN_PORT" in problem


def test_a_word_that_the_deployment_does_not_know_is_refused_with_those_it_does(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_MQTT_BROKER", "mosquito")
    assert main() == 1
    assert "known are embedded, mosquitto, external" in capsys.readouterr().err


def test_an_arm_without_motors_starts_with_a_virtual_device_and_is_refused_a_board(free, tmp_path, capsys, monkeypatch):
    folder = write_bare_arm(tmp_path / "bare")
    bare = msgspec.structs.replace(free, robot=str(folder))
    assert problems(bare) == []
    monkeypatch.setattr("gemelo.tools.stack.start_check.load_deployment", lambda: bare)
    assert main() == 0
    assert "no motors: to plan and look at only; a virtual device is generated, at" in capsys.readouterr().out
    (problem,) = problems(msgspec.structs.replace(bare, device=DeviceKind.BOARD))
    assert "a [joint.motor] for every joint" in problem


def test_what_make_up_refuses_is_said_in_the_language_of_the_terminal(free, monkeypatch, capsys):
    monkeypatch.setenv("LANG", "es_MX.UTF-8")
    monkeypatch.setenv("GEMELO_ROBOT", "urdf/nobody")
    assert main() == 1
    assert "urdf/nobody/robot.toml: el archivo no existe" in capsys.readouterr().err
