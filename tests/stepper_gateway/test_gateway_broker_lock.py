"""The link against a mosquitto with TLS, users and an ACL: a sentence for everything that keeps it out."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.firmware.platform.host.link import COMMANDS, REPORTS
from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import device_access, gateway_access
from gemelo.schemas.deployment import Broker, MqttSection
from gemelo.services.stepper_gateway.links.link import FROM_DEVICE, TO_DEVICE, Kind
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from tests.stepper_gateway.locked import Mosquitto, external, locked, published, reason_of, renew, secret, wait_for
from tests.stepper_gateway.processes import free_port

NOT_AUTHORISED = 135


@contextmanager
def serving(section: MqttSection, *lines: str) -> Iterator[Mosquitto]:
    broker = Mosquitto(Path(section.secure_folder).parent, section, *lines)
    try:
        yield broker
    finally:
        broker.stop()


@pytest.mark.full
def test_a_gateway_joins_a_locked_broker_by_its_folder_or_by_each_setting(tmp_path: Path) -> None:
    section = locked(tmp_path / "lock")
    with serving(section):
        assert reason_of(section) == ""
        assert reason_of(external(section)) == ""


def test_each_mistake_of_password_and_certificate_is_one_sentence_with_its_remedy(tmp_path: Path) -> None:
    section = locked(tmp_path / "lock")
    stranger = tmp_path / "other.pem"
    Authority(stranger, tmp_path / "other.key")
    mine = external(section)
    with serving(section):
        wrong = reason_of(replace(mine, password_file=secret(tmp_path, "wrong\n")))
        assert 'refuses user "gateway"' in wrong
        assert "the password is wrong" in wrong
        assert "lets nobody in without a user and a password" in reason_of(replace(mine, user=""))
        other = reason_of(replace(mine, ca=str(stranger)))
        assert f"is not signed by the authority in {stranger}" in other
        assert "set mqtt.ca" in other
        unknown = reason_of(replace(mine, ca=""))
        assert "is not signed by an authority that this system knows" in unknown
        name = reason_of(replace(mine, host="localhost"))
        assert 'is for another name than "localhost"' in name
        assert "gemelo broker secure --host localhost" in name
        assert "does that port want TLS" in reason_of(replace(mine, tls=False, ca="", user="", password_file=""))
        assert 'no machine is called "nowhere.invalid"' in reason_of(replace(mine, host="nowhere.invalid"))
    renew(section, "127.0.0.1", days=-1)
    with serving(section):
        assert "has expired: renew it" in reason_of(mine)


@pytest.mark.full
def test_a_port_without_tls_is_said_to_be_one(tmp_path: Path) -> None:
    section = replace(locked(tmp_path / "lock"), secure_folder="")
    broker = Mosquitto(tmp_path, section)
    try:
        said = reason_of(external(replace(section, secure_folder=str(tmp_path / "lock"))))
    finally:
        broker.stop()
    assert "TLS" in said
    assert "mostly 8883" in said


@pytest.mark.full
def test_a_broker_that_wants_a_certificate_of_ours_gets_it_or_says_so(tmp_path: Path) -> None:
    section = locked(tmp_path / "lock")
    folder = Path(section.secure_folder)
    certificate, key = folder / "client.pem", folder / "client.key"
    Authority(folder / "ca.pem", folder / "ca.key").sign_client("gateway", certificate, key)
    mine = external(section)
    with serving(section, f"cafile {folder / 'ca.pem'}", "require_certificate true"):
        assert reason_of(replace(mine, certificate=str(certificate), key=str(key))) == ""
        assert "mqtt.certificate" in reason_of(mine)


@pytest.mark.full
def test_an_acl_that_denies_is_said_with_its_topic_though_mosquitto_drops_silently(tmp_path: Path) -> None:
    section = locked(tmp_path / "lock")
    acl = Path(section.secure_folder, "acl")
    for kind in (Kind.HB, Kind.SYNC, Kind.CMD, Kind.TRAJ):
        kept = acl.read_text()
        acl.write_text(kept.replace(f"topic write gemelo/v1/+/{kind}\n", ""))
        with serving(section), closing(MqttLink(gateway_access(section), "rm1", lambda: None)) as link:
            wait_for(lambda link=link: link.connected)
            link.send(Kind.HB, b"x")
            link.send(kind, b"x")
            wait_for(lambda link=link: not link.connected)
            assert f'does not let user "gateway" write gemelo/v1/rm1/{kind}: its ACL must allow it' in str(link.reason)
        acl.write_text(kept)


@pytest.mark.full
def test_a_device_writes_its_own_topics_only_and_nobody_but_the_gateway_commands(tmp_path: Path) -> None:
    section = locked(tmp_path / "lock", "rm1", "other")
    gateway, device = gateway_access(section), device_access(section, "rm1")
    with serving(section):
        for kind in TO_DEVICE:
            assert published(device, f"gemelo/v1/rm1/{kind}") == NOT_AUTHORISED
            assert published(gateway, f"gemelo/v1/rm1/{kind}") < 0x80
        for kind in FROM_DEVICE:
            assert published(device, f"gemelo/v1/rm1/{kind}") < 0x80
            assert published(device, f"gemelo/v1/other/{kind}") == NOT_AUTHORISED
            assert published(gateway, f"gemelo/v1/rm1/{kind}") == NOT_AUTHORISED


@pytest.mark.full
def test_a_refused_gateway_asks_ever_more_seldom_and_a_vanished_broker_is_met_again_at_once(tmp_path: Path) -> None:
    section = locked(tmp_path / "lock")
    refused = replace(external(section), password_file=secret(tmp_path, "wrong\n"))
    with serving(section) as broker:
        with closing(MqttLink(gateway_access(refused), "rm1", lambda: None)):
            time.sleep(2.5)  # attempts at 0, 1.1 and 3.3 s
            assert broker.log.count("Sending CONNACK") in (1, 2)
        with closing(MqttLink(gateway_access(section), "rm1", lambda: None)) as link:
            wait_for(lambda: link.connected)
            broker.stop()
            wait_for(lambda: "no MQTT broker answers" in str(link.reason))
            broker.start()
            began = time.monotonic()
            wait_for(lambda: link.connected)
            assert time.monotonic() - began < 6.0


def serve_old(listening: socket.socket, answer: bytes) -> None:
    """A broker of MQTT 3.1.1, which has `answer` for another version, and hangs up."""
    while True:
        try:
            wire, _ = listening.accept()
        except OSError:
            return
        with wire:
            if wire.recv(1024)[8] != 4:
                wire.sendall(answer)
                continue
            wire.sendall(b"\x20\x02\x00\x00")
            subscribe = wire.recv(4096)
            number = subscribe.index(b"\x00")  # after the length: the packet's number has two bytes, the first 0
            wire.sendall(
                b"\x90" + bytes([2 + len(FROM_DEVICE)]) + subscribe[number : number + 2] + b"\x01" * len(FROM_DEVICE)
            )
            while wire.recv(4096):
                pass


@pytest.mark.parametrize("answer", [b"\x20\x02\x00\x01", b""], ids=["says so", "hangs up"])
def test_an_old_broker_is_joined_by_its_own_version(answer: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=serve_old, args=(listening, answer), daemon=True).start()
        section = MqttSection(broker=Broker.EXTERNAL, port=listening.getsockname()[1])
        with closing(MqttLink(gateway_access(section, {}), "rm1", lambda: None)) as link:
            wait_for(lambda: link.connected)


def test_the_topics_of_the_acl_are_those_of_the_wire() -> None:
    text = secure_folder.acl(["rm1"])
    gateway, device = text.split("user rm1")
    to_device = [line.split("/", 3)[3] for line in gateway.splitlines() if "write" in line and "topic" in line]
    from_device = [line.split("/", 3)[3] for line in device.splitlines() if "write" in line]
    # `gemelo device update` speaks as the gateway does, on topics that the gateway itself has no use for.
    assert to_device == [*TO_DEVICE, "update"]
    assert from_device == [*FROM_DEVICE, "update/ack"]
    assert set(to_device) == set(COMMANDS)  # all that a device hears
    assert set(from_device) == set(REPORTS)  # and says


def test_nothing_answers_at_a_stranger_is_said_with_the_settings() -> None:
    section = MqttSection(broker=external(MqttSection(secure_folder="x")).broker, port=free_port())
    assert "are its address and port right (mqtt.host, mqtt.port)?" in reason_of(section)
