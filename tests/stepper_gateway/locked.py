"""A real mosquitto behind the lock of `gemelo broker secure`, and links to it."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import BrokerAccess, gateway_access
from gemelo.libraries.mqtt.client import MqttClient
from gemelo.schemas.deployment import Broker, MqttSection
from gemelo.services.broker import mosquitto
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from tests.optional import need
from tests.stepper_gateway.processes import free_port

PATIENCE = 60.0  # [s]


class Mosquitto:
    """One broker; `lines` are added to what gemelo's own would have."""

    def __init__(self, folder: Path, section: MqttSection, *lines: str) -> None:
        need("mosquitto")
        self._conf = folder / "mosquitto.conf"
        self._log = folder / "mosquitto.log"
        self._conf.write_text("\n".join((mosquitto.configuration(section), "log_type all", *lines)))
        self.process: subprocess.Popen[bytes] | None = None
        self._running = section.listening
        self.start()

    def start(self) -> None:
        with self._log.open("ab") as log:
            self.process = subprocess.Popen([mosquitto.find(), "-c", str(self._conf)], stderr=log)
        wait_for(lambda: "mosquitto version" in self.log and "running" in self.log, self.process)

    def stop(self) -> None:
        assert self.process is not None
        self.process.kill()
        self.process.wait()
        self._log.write_text("")

    def close(self) -> None:
        self.stop()

    @property
    def log(self) -> str:
        return self._log.read_text()


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[bytes] | None = None) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert process is None or process.poll() is None, "the broker has ended"
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


def locked(folder: Path, *devices: str) -> MqttSection:
    """A deployment with a lock of its own in `folder`."""
    secure_folder.make(folder, ["127.0.0.1"], devices or ["rm1"])
    return MqttSection(broker=Broker.MOSQUITTO, port=free_port(), secure_folder=str(folder))


def external(section: MqttSection, **changes: object) -> MqttSection:
    """The same broker as a stranger's: nothing is taken from a secure folder."""
    folder = Path(section.secure_folder)
    known = {"tls": True, "ca": str(folder / "ca.pem"), "user": "gateway"}
    known["password_file"] = str(folder / "gateway.password")
    return replace(section, broker=Broker.EXTERNAL, secure_folder="", **{**known, **changes})  # type: ignore[arg-type]


def renew(section: MqttSection, *hosts: str, days: int = 1) -> None:
    """Another certificate of the broker's, by the same authority."""
    folder = Path(section.secure_folder)
    authority = Authority(folder / "ca.pem", folder / "ca.key")
    authority.sign(hosts, folder / "server.pem", folder / "server.key", days)


def reason_of(section: MqttSection) -> str:
    """What a gateway's link says of the broker: nothing where it is connected."""
    link = MqttLink(gateway_access(section, {}), "rm1", lambda: None)
    try:
        wait_for(lambda: link.connected or "no connection yet" not in str(link.reason))
        return str(link.reason or "")
    finally:
        link.close()


def secret(folder: Path, text: str) -> str:
    """The path of a password file."""
    path = folder / "a.password"
    secure_folder.write(path, text)
    return str(path)


def published(access: BrokerAccess, topic: str) -> int:
    """The broker's reason code for a message of QoS 1."""
    answers: list[int] = []
    client = MqttClient(access, f"test-{os.getpid()}-{time.time_ns()}")
    client.on_connect = lambda *_: client.publish(topic, b"x", 1)
    client.on_publish = lambda _client, _data, _id, reason, _props: answers.append(reason.value)
    client.connect(access.host, access.port)
    client.loop_start()
    wait_for(lambda: bool(answers))
    client.disconnect()
    client.loop_stop()
    return answers[0]
