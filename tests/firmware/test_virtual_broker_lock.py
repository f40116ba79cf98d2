"""The virtual device against a mosquitto with TLS, users and an ACL: one sentence for each refusal, and no storm."""

from __future__ import annotations

import queue
import time
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.firmware.platform.host.flash import NetworkCredentials
from gemelo.firmware.platform.host.link import Connected, Denied, DeviceLink, Disconnected, Item, MqttMessage
from gemelo.firmware.platform.host.network import AddressError, broker_address
from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import BrokerAccess, device_access, gateway_access
from gemelo.libraries.mqtt.client import MqttClient
from gemelo.schemas.device_topics import topic
from tests.stepper_gateway.locked import Mosquitto, locked, renew

pytestmark = pytest.mark.full

WATCHED = 2.5  # [s] attempts at 0, 1 and 3 s


def joined(broker: BrokerAccess, seconds: float) -> list[Item]:
    """What a device hears of its broker until it is in, or for so long."""
    inbox: queue.SimpleQueue[Item] = queue.SimpleQueue()
    link = DeviceLink(broker, "rm1", b"gone", inbox)
    link.start()
    heard: list[Item] = []
    end = time.monotonic() + seconds
    while time.monotonic() < end and not any(isinstance(item, Connected) for item in heard):
        try:
            heard.append(inbox.get(timeout=max(0.0, end - time.monotonic())))
        except queue.Empty:
            break
    link.break_off()
    return heard


@pytest.fixture(scope="module")
def section(tmp_path_factory):
    folder = tmp_path_factory.mktemp("broker")
    section = locked(folder / "lock")
    with closing(Mosquitto(folder, section)):
        yield section


def told(section, **changes):
    """The broker as a board is told of it."""
    folder = Path(section.secure_folder)
    credentials = NetworkCredentials(
        device="rm1",
        mqtt_uri=f"mqtts://127.0.0.1:{section.port}",
        mqtt_user="rm1",
        mqtt_password=secure_folder.password_of(folder, "rm1"),
        mqtt_ca=(folder / "ca.pem").read_text(),
    )
    return broker_address(replace(credentials, **changes), BrokerAccess("127.0.0.1", 1))


def test_a_provisioned_board_joins(section):
    assert isinstance(joined(told(section), 10.0)[-1], Connected)


def test_a_broker_that_asks_for_certificates_lets_a_board_in_that_was_given_one(tmp_path):
    section = locked(tmp_path / "lock")
    folder = Path(section.secure_folder)
    own, key = tmp_path / "rm1.pem", tmp_path / "rm1.key"
    Authority(folder / "ca.pem", folder / "ca.key").sign_client("rm1", own, key)
    Authority(tmp_path / "other.pem", tmp_path / "other.key").sign_client("rm1", tmp_path / "x.pem", tmp_path / "x.key")
    wants = (f"cafile {folder / 'ca.pem'}", "require_certificate true")
    with closing(Mosquitto(tmp_path, section, *wants)):
        (without, *_) = joined(told(section), 1.0)
        stranger = told(
            section, mqtt_certificate=(tmp_path / "x.pem").read_text(), mqtt_key=(tmp_path / "x.key").read_text()
        )
        (unknown, *_) = joined(stranger, 1.0)
        (known, *_) = joined(told(section, mqtt_certificate=own.read_text(), mqtt_key=key.read_text()), 10.0)
    assert isinstance(without, Disconnected)
    assert "certificate" in without.reason
    assert isinstance(unknown, Disconnected)
    assert "certificate" in unknown.reason
    assert isinstance(known, Connected)
    with pytest.raises(AddressError, match="mqtt_certificate and mqtt_key cannot be used"):
        told(section, mqtt_certificate=own.read_text(), mqtt_key=(tmp_path / "x.key").read_text())


def test_each_refusal_is_the_same_sentence_again_and_again_at_growing_pauses(section, tmp_path):
    Authority(tmp_path / "other.pem", tmp_path / "other.key")
    uri = f"mqtts://localhost:{section.port}"
    cases = [
        (told(section, mqtt_password="wrong"), 'refuses user "rm1"'),
        (told(section, mqtt_ca=(tmp_path / "other.pem").read_text()), "is not signed by the authority in"),
    ]
    for broker, sentence in cases:
        heard = joined(broker, WATCHED)
        assert heard
        assert {type(item) for item in heard} == {Disconnected}
        assert len(heard) <= 3
        assert all(isinstance(item, Disconnected) and sentence in item.reason for item in heard)
    plain = joined(told(section, mqtt_uri=uri.replace("mqtts", "mqtt").replace("localhost", "127.0.0.1")), 1.0)
    assert isinstance(plain[0], Disconnected)
    assert "does that port want TLS" in plain[0].reason


def test_a_name_that_the_certificate_lacks_and_one_that_has_expired_are_said(tmp_path):
    section = locked(tmp_path / "lock")
    renew(section, "broker.lan")
    with closing(Mosquitto(tmp_path, section)):
        (first, *_) = joined(told(section), 1.0)
    renew(section, "127.0.0.1", days=-1)
    with closing(Mosquitto(tmp_path, section)):
        (second, *_) = joined(told(section), 1.0)
    assert isinstance(first, Disconnected)
    assert 'is for another name than "127.0.0.1"' in first.reason
    assert isinstance(second, Disconnected)
    assert "has expired" in second.reason


def test_what_the_acl_denies_is_said_with_its_topic(section):
    inbox: queue.SimpleQueue[Item] = queue.SimpleQueue()
    link = DeviceLink(device_access(section, "rm1"), "other", b"gone", inbox)
    link.start()
    try:
        said = inbox.get(timeout=60.0)
        if isinstance(said, Connected):
            link.publish("state", b"x")
            said = inbox.get(timeout=60.0)
    finally:
        link.break_off()
    assert isinstance(said, (Denied, Disconnected))
    assert 'user "rm1"' in said.reason


def test_two_devices_of_one_name_do_not_end_each_others_connections(section):
    links, inboxes = [], []
    try:
        for _ in range(2):
            inboxes.append(queue.SimpleQueue())
            links.append(DeviceLink(told(section), "rm1", b"gone", inboxes[-1]))
            links[-1].start()
            assert isinstance(inboxes[-1].get(timeout=60.0), Connected)
        gateway = MqttClient(gateway_access(section), "one-command")
        gateway.connect("127.0.0.1", section.port)
        gateway.loop_start()
        gateway.publish(topic("rm1", "cmd"), b"\0\0\x03", qos=1, retain=True)  # for whoever has yet to subscribe
        for inbox in inboxes:  # nothing was lost before it
            assert isinstance(inbox.get(timeout=60.0), MqttMessage)
        gateway.publish(topic("rm1", "cmd"), b"", qos=1, retain=True).wait_for_publish(10.0)
        gateway.disconnect()
        gateway.loop_stop()
    finally:
        for link in links:
            link.break_off()
