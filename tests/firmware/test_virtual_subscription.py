"""A device that its broker sends nothing, though it is connected: it subscribes anew; with a real mosquitto."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from schemas.device_topics import topic
from services.stepper_gateway.links.frames import Sync, encode
from tests.stepper_gateway.processes import DEVICE, Processes

pytestmark = pytest.mark.full

NAME = "rm1"
CONNECT = 0x10
SUBSCRIBE = 0x82  # first byte of the packet, MQTT 3.1.1, 3.8.1
SOON = 10.0  # [s] 4 s of silence, and a start on a loaded machine


class Proxy:
    """Between a device and its broker; swallows the first `swallowed` SUBSCRIBE packets, and keeps the client id."""

    def __init__(self, broker: int, swallowed: int) -> None:
        self._broker, self._left = broker, swallowed
        self.swallowed = 0
        self.client_id = ""
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self._open: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        for each in (self._listening, *self._open):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                device = self._listening.accept()[0]
                broker = socket.create_connection(("127.0.0.1", self._broker))
                self._open += [device, broker]
                threading.Thread(target=self._to_broker, args=(device, broker), daemon=True).start()
                threading.Thread(target=_copy, args=(broker, device), daemon=True).start()

    def _to_broker(self, device: socket.socket, broker: socket.socket) -> None:
        with suppress(OSError), device.makefile("rb") as packets:
            while head := packets.read(1):
                length, size = b"", 0
                while not length or length[-1] & 0x80:  # MQTT 3.1.1, 2.2.3
                    length += packets.read(1)
                    size |= (length[-1] & 0x7F) << 7 * (len(length) - 1)
                body = packets.read(size)
                if head[0] == CONNECT:
                    self.client_id = _client_id(body)
                if head[0] == SUBSCRIBE and self.swallowed < self._left:
                    self.swallowed += 1
                else:
                    broker.sendall(head + length + body)


def _client_id(connect: bytes) -> str:
    """Behind protocol, flags and keep-alive (10 bytes) and the properties of MQTT 5, fewer than 128 bytes."""
    at = 10 + (1 + connect[10] if connect[6] == 5 else 0)
    return connect[at + 2 : at + 2 + int.from_bytes(connect[at : at + 2])].decode()


def _copy(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while data := source.recv(4096):
            target.sendall(data)


class Asker:
    """A client that asks the device for its clock, ten times a second, and counts the answers."""

    def __init__(self, port: int) -> None:
        self.answers = 0
        self._client = paho.Client(CallbackAPIVersion.VERSION2)
        self._client.on_message = self._on_message
        self._client.connect("127.0.0.1", port)
        self._client.subscribe([(topic(NAME, "sync/r"), 0), (topic(NAME, "status"), 1)])
        self._client.loop_start()
        self.is_online = False

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        self.is_online |= message.topic.endswith("status")
        self.answers += message.topic.endswith("sync/r")

    def wait(self, is_done: Callable[[], bool]) -> bool:
        """Asks until then; False if it does not come SOON."""
        end = time.monotonic() + SOON
        while not is_done() and time.monotonic() < end:
            self._client.publish(topic(NAME, "sync"), encode(Sync(boot_id=0, t0=time.monotonic_ns() // 1000)))
            time.sleep(0.1)  # ten questions a second
        return is_done()

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Processes]:
    with closing(Processes("mosquitto", tmp_path)) as processes:
        processes.start_broker()
        yield processes


def test_a_device_whose_subscription_was_lost_subscribes_anew(broker: Processes) -> None:
    with closing(Proxy(broker.port, swallowed=1)) as proxy, closing(Asker(broker.port)) as asker:
        broker.start(DEVICE, environment={"GEMELO_MQTT_PORT": str(proxy.port)})
        assert asker.wait(lambda: asker.is_online and proxy.swallowed == 1), broker.log
        assert asker.wait(lambda: asker.answers > 0), broker.log


def test_a_device_receives_again_after_a_second_client_has_taken_over_its_id(broker: Processes) -> None:
    with closing(Proxy(broker.port, swallowed=0)) as proxy, closing(Asker(broker.port)) as asker:
        broker.start(DEVICE, environment={"GEMELO_MQTT_PORT": str(proxy.port)})
        assert asker.wait(lambda: asker.answers > 0), broker.log
        other = paho.Client(CallbackAPIVersion.VERSION2, client_id=proxy.client_id)
        other.connect("127.0.0.1", broker.port)
        other.loop_start()
        assert asker.wait(lambda: "lost the broker" in broker.log), broker.log
        other.disconnect()
        other.loop_stop()
        before = asker.answers
        assert asker.wait(lambda: asker.answers > before + 3), broker.log
