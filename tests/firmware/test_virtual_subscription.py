"""A device that its broker sends nothing, though it is connected: it subscribes anew; with a real mosquitto."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.schemas.device_topics import topic
from gemelo.services.stepper_gateway.links.frames import Sync, encode
from gemelo.tools.chaos.slow_link import client_id_in
from tests.mqtt.packet_proxy import PacketProxy
from tests.stepper_gateway.processes import DEVICE, Processes

pytestmark = pytest.mark.full

NAME = "rm1"
SUBSCRIBE = 0x82  # first byte of the packet, MQTT 3.1.1, 3.8.1
SOON = 10.0  # [s] 4 s of silence, and a start on a loaded machine


class Proxy:
    """Between a device and its broker; swallows the first `swallowed` SUBSCRIBE packets, and keeps the client id."""

    def __init__(self, broker: int, swallowed: int) -> None:
        self._left = swallowed
        self.swallowed = 0
        self.client_id = ""
        self._proxy = PacketProxy(broker, to_broker=self._passes)
        self.port, self.close = self._proxy.port, self._proxy.close

    def _passes(self, packet: bytes) -> bool:
        self.client_id = client_id_in(packet) or self.client_id
        is_swallowed = packet[0] == SUBSCRIBE and self.swallowed < self._left
        self.swallowed += is_swallowed
        return not is_swallowed


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
