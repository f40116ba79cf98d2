"""Strangers on both buses: what they send is old, changed or without a meaning."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from random import Random

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.libraries.runtime.actions.keys import feedback_topic, status_topic
from gemelo.libraries.runtime.bus.branches import is_of_many
from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.message import M, encode
from gemelo.schemas.topics import ACTIONS, CAMERA_TOPICS, TOPICS, Delivery, Topic

KEPT = 200  # frames of the wire that can be said again
STRANGER = "stranger"  # its name where each node has a key of its own


class WireStranger:
    """A client of the broker that hears every frame, and says old, changed or meaningless ones."""

    def __init__(self, port: int) -> None:
        self._heard: deque[tuple[str, bytes]] = deque(maxlen=KEPT)
        self._client = Client(CallbackAPIVersion.VERSION2, client_id="chaos")
        self._client.on_connect = lambda client, *_: client.subscribe("gemelo/v1/#", qos=0)
        self._client.on_message = self._hear
        self._client.reconnect_delay_set(1, 2)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def close(self) -> None:
        """Leaves the broker."""
        self._client.disconnect()
        stop_loop(self._client)

    def repeat(self, random: Random, count: int) -> None:
        """Says `count` of the newest frames once more."""
        self._say(self._some(random, count))

    def garble(self, random: Random, count: int) -> None:
        """Says `count` of the newest frames with some of their bytes changed."""
        self._say([(topic, _changed(random, frame)) for topic, frame in self._some(random, count) if frame])

    def noise(self, random: Random, count: int) -> None:
        """Says `count` frames of random bytes on topics that are in use."""
        self._say([(topic, random.randbytes(random.randrange(300))) for topic, _ in self._some(random, count)])

    def _some(self, random: Random, count: int) -> list[tuple[str, bytes]]:
        return [random.choice(self._heard) for _ in range(count) if self._heard]

    def _say(self, frames: list[tuple[str, bytes]]) -> None:
        for topic, frame in frames:
            self._client.publish(topic, frame, qos=0)

    def _hear(self, _client: Client, _data: object, message: MQTTMessage) -> None:
        self._heard.append((message.topic, bytes(message.payload)))


class BusStranger:
    """A participant of the bus that puts what nobody can read on every key."""

    def __init__(self, router_port: int, robot: str, cameras: Sequence[str]) -> None:
        self._bus = ZenohBus(RouterSection(port=router_port), robot)
        seen = [make(camera) for camera in cameras for make in CAMERA_TOPICS]
        actions = [make(action) for action in ACTIONS for make in (feedback_topic, status_topic)]
        self._keys: list[tuple[str, str, Delivery]] = [
            (topic.key, topic.message.__name__, topic.delivery) for topic in (*TOPICS, *seen, *actions)
        ]

    def close(self) -> None:
        """Leaves the bus."""
        self._bus.close()

    def ask(self, key: str, schema: str, payload: bytes, timeout: float) -> BusReply | None:
        """The answer to one request; None where there is none within `timeout` [s]."""
        answers: SimpleQueue[BusReply | None] = SimpleQueue()
        self._bus.ask(key, schema, payload, timeout, answers.put)
        with suppress(Empty):
            return answers.get(timeout=timeout + 1.0)
        return None

    def publish(self, topic: Topic[M], message: M) -> None:
        """One message, as a client of its own."""
        publication = self._bus.publish(topic.key, topic.message.__name__, topic.delivery, STRANGER)
        publication.put(encode(message))
        publication.close()

    def noise(self, random: Random) -> None:
        """Random bytes on every key, under its own schema's name or another."""
        for key, schema, delivery in self._keys:
            writer = STRANGER if is_of_many(key) else ""  # elsewhere it is not even signed
            publication = self._bus.publish(key, random.choice((schema, "", "Nonsense")), delivery, writer)
            publication.put(random.randbytes(random.randrange(300)))
            publication.close()


def _changed(random: Random, frame: bytes) -> bytes:
    changed = bytearray(frame)
    for _ in range(random.randint(1, 4)):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)
