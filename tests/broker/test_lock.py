"""The lock of `gemelo broker secure` on both brokers: one folder of users, ACL and TLS, the same for either."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import tls_context
from gemelo.schemas.device_topics import FROM_DEVICE, TO_DEVICE
from tests.broker.running import BROKERS, Client, RunningBroker

COMMAND, STATE, STATUS = "gemelo/v1/rm1/cmd", "gemelo/v1/rm1/state", "gemelo/v1/rm1/status"
NOT_AUTHORISED = 135
REFUSED = {4, 5, 134, 135}  # CONNACK of MQTT 3.1.1 and 5
DENIED = {128, 135}  # SUBACK

Join = Callable[..., Client]


@pytest.fixture(scope="module", params=BROKERS)
def locked(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningBroker]:
    folder = tmp_path_factory.mktemp(f"locked-{request.param}")
    secure_folder.make(folder / "lock", ["127.0.0.1"], ["rm1", "other"])
    running = RunningBroker(request.param, folder, secure_folder=folder / "lock").wait_ready()
    yield running
    running.stop()


@pytest.fixture
def come(locked: RunningBroker, version: str) -> Iterator[Join]:
    """Makes clients of a user, by TLS; `password` and what else is not said is right."""
    lock = locked.folder / "lock"
    with ExitStack() as all_of_them:

        def came(user: str, password: str = "", **options: object) -> Client:
            credentials = (user, password or secure_folder.password_of(lock, user))
            trusted = tls_context(str(lock / "ca.pem"))
            client = Client(locked.port, "", version, user=credentials, tls=trusted, **options)  # type: ignore[arg-type]
            all_of_them.callback(client.close)
            return client

        yield came


def answer_of(client: Client) -> int:
    return client.answers.get(timeout=60.0)


def test_only_a_user_with_the_right_password_comes_in(locked, come):
    come("gateway").connected()
    assert answer_of(come("gateway", "wrong")) in REFUSED
    assert answer_of(come("nobody", "wrong")) in REFUSED
    assert answer_of(come("", "x")) in REFUSED


def test_commands_come_from_the_gateway_alone_and_reports_from_the_device_alone(come, version):
    gateway, device, other = come("gateway").connected(), come("rm1").connected(), come("other").connected()
    gateway.subscribe("gemelo/v1/+/state")
    device.subscribe("gemelo/v1/rm1/+")
    denied = (device.publish(COMMAND, "of a device"), other.publish(COMMAND, "of another"),
              gateway.publish(STATE, "of the gateway"), other.publish(STATE, "of another"))  # fmt: skip
    assert set(denied) == ({NOT_AUTHORISED} if version == "5" else {0})  # 3.1.1 has no word for it
    assert gateway.publish(COMMAND, "of the gateway") < 0x80
    assert device.publish(STATE, "of a device") < 0x80
    assert device.next() == (COMMAND, "of the gateway")
    assert gateway.next() == (STATE, "of a device")
    assert gateway.messages.empty()
    assert device.messages.empty()


def test_every_topic_of_the_wire_passes_in_its_one_direction(come):
    gateway, device = come("gateway").connected(), come("rm1").connected()
    for sender, reader, kinds in ((gateway, device, TO_DEVICE), (device, gateway, FROM_DEVICE)):
        for kind in kinds:
            reader.subscribe(f"gemelo/v1/rm1/{kind}")
            sender.publish(f"gemelo/v1/rm1/{kind}", "x")
            assert reader.next() == (f"gemelo/v1/rm1/{kind}", "x")


@pytest.mark.parametrize(
    "filter", ["#", "gemelo/#", "gemelo/v1/rm1/#", "+/+/+/state", "$share/group/gemelo/v1/rm1/state"]
)
def test_a_device_reads_nothing_of_another_whatever_it_subscribes_to(come, filter):
    device, other, gateway = come("rm1").connected(), come("other").connected(), come("gateway").connected()
    other.subscribe(filter)
    other.subscribe("gemelo/v1/other/hb")
    device.publish(STATE, "not for others", retain=True)
    other.subscribe(filter)  # which would send what is retained
    gateway.publish("gemelo/v1/other/hb", "last")
    assert other.next() == ("gemelo/v1/other/hb", "last")


def test_no_will_gets_round_the_acl(come):
    """The embedded broker refuses who comes with such a will, mosquitto drops it."""
    reader, gateway = come("rm1").connected(), come("gateway").connected()
    reader.subscribe(COMMAND)
    sly = come("rm1", will=(COMMAND, "move", False))
    if answer_of(sly) == 0:
        sly.cut()
    gateway.publish(COMMAND, "of the gateway")
    assert reader.next() == (COMMAND, "of the gateway")
    gateway.subscribe(STATUS)
    come("rm1", will=(STATUS, "offline", True)).connected().cut()
    assert gateway.next() == (STATUS, "offline")


def test_who_does_not_speak_tls_or_trusts_another_authority_does_not_come_in(locked, tmp_path, version):
    Authority(tmp_path / "other.pem", tmp_path / "other.key")
    stranger = tls_context(str(tmp_path / "other.pem"))
    with socket.create_connection(("127.0.0.1", locked.port)) as link, pytest.raises(ssl.SSLCertVerificationError):
        stranger.wrap_socket(link, server_hostname="127.0.0.1")
    plain = Client(locked.port, "", version, user=("gateway", "x"))
    plain.ends.get(timeout=60.0)
    assert plain.answers.empty()
    plain.close()


@pytest.mark.parametrize("name", BROKERS)
def test_beyond_loopback_none_listens_without_tls_unless_it_is_said_to(tmp_path, name):
    refused = RunningBroker(name, tmp_path / "refused", host="127.0.0.1", listen_host="0.0.0.0")
    assert refused.popen.wait(timeout=60.0) == 1
    assert "gemelo broker secure" in refused.output
    assert "GEMELO_MQTT_INSECURE" in refused.output
    insecure = RunningBroker(name, tmp_path / "insecure", host="127.0.0.1", listen_host="0.0.0.0", insecure="true")
    assert "INSECURE" in insecure.wait_ready().stop()


@pytest.mark.parametrize("name", BROKERS)
def test_a_lock_that_was_never_made_is_said_with_the_command_that_makes_it(tmp_path, name):
    (tmp_path / "empty").mkdir()
    process = RunningBroker(name, tmp_path, secure_folder=tmp_path / "empty")
    assert process.popen.wait(timeout=60.0) == 1
    assert "`gemelo broker secure` makes it" in process.output


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("users", "gateway:plain\n", "line 1: the password of \"gateway\" is not in the form $7$"),
        ("users", "# none\ngateway:$7$x$AA==$AA==\n", "line 2: the iterations, salt or hash of \"gateway\""),
        ("acl", "user gateway\ntopic deny gemelo/#\n", "line 2: \"topic deny gemelo/#\": deny is not one of read"),
        ("acl", "topic read gemelo/#\n", "line 1: \"topic read gemelo/#\" stands before the first user"),
        ("acl", "user gateway\npattern read %u/#\n", "line 2: \"pattern read %u/#\" is neither user NAME nor topic"),
        ("server.key", "none\n", "server.key cannot be used"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_file_of_the_lock_is_named_with_its_line_and_the_remedy(tmp_path, file, text, said):
    """mosquitto has words of its own for them."""
    secure_folder.make(tmp_path / "lock", ["127.0.0.1"], ["rm1"])
    Path(tmp_path, "lock", file).write_text(text)
    process = RunningBroker("embedded", tmp_path, secure_folder=tmp_path / "lock")
    assert process.popen.wait(timeout=60.0) == 1
    assert said in process.output
    assert "gemelo broker secure" in process.output.splitlines()[-1]
