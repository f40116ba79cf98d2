"""The virtual ESP32's MQTT: paho's thread only puts into an inbox, with the time of arrival."""

from __future__ import annotations

import contextlib
import logging
import queue
import secrets
import socket
import threading
import time
from dataclasses import dataclass

from paho.mqtt import client as paho

from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import NO_ANSWER, OLD_BROKER, MqttClient, code_of, is_failure
from gemelo.libraries.mqtt.failures import denial, failure, needs_a_person, refusal, silence
from gemelo.libraries.runtime.firmware_update import UPDATE
from gemelo.schemas.device_topics import topic

log = logging.getLogger("virtual_esp32")

COMMANDS = {"traj": 1, "cmd": 1, "hb": 0, "sync": 0, "config": 1, "inject": 1, "update": 1}  # QoS of the subscription
REPORTS = {  # QoS of the publication
    "traj/ack": 0, "cmd/ack": 1, "sync/r": 0, "state": 0, "event": 1, "status": 1,
    "config/ack": 1, "sensors": 0, "shaft": 0,
    "update/ack": 1,
}  # fmt: skip
FRAME_TYPES = {"traj": 1, "cmd": 3, "hb": 5, "sync": 6, "update": UPDATE}
LARGEST = 16_384  # [bytes] the largest chunk has 8,228
FULL_INBOX = 4096  # [messages]
KEEP_ALIVE = 5  # [s]
RETRY = (0.2, 1.0)  # [s] shortest and longest pause between attempts
RETRY_REFUSED = (1.0, 16.0)  # [s] the same while only a person can mend it
MOST_UNANSWERED = 1024  # [messages] whose topic is remembered for the broker's answer


@dataclass(frozen=True)
class MqttMessage:
    """One message; a frame on the wrong topic, and whatever is too long, comes as no bytes at all."""

    kind: str  # the last part of its topic
    payload: bytes
    retained: bool
    monotonic: float  # [s]


@dataclass(frozen=True)
class SerialBytes:
    """A piece of what came over the serial line."""

    data: bytes
    monotonic: float  # [s]


@dataclass(frozen=True)
class Connected:
    """The broker has accepted us."""


@dataclass(frozen=True)
class Disconnected:
    """The connection is gone; paho tries again by itself."""

    reason: str


@dataclass(frozen=True)
class Denied:
    """The broker's ACL does not let the device write a topic."""

    reason: str


@dataclass(frozen=True)
class ShutdownRequested:
    """The process is asked to end."""


Item = MqttMessage | SerialBytes | Connected | Disconnected | Denied | ShutdownRequested


class DeviceLink:
    """One device's topics at one broker."""

    def __init__(self, broker: BrokerAccess, device: str, will: bytes, inbox: queue.SimpleQueue[Item]) -> None:
        self._topic = topic(device, "")
        self._inbox = inbox
        # Random, so that two devices of one name do not end each other's connections; one for all of a boot, so that a
        # connection ends the one before, whose last will then does not come late.
        client_id = f"gemelo-device-{device}-{secrets.token_hex(6)}"
        self._client = MqttClient(broker, client_id, reconnect_on_failure=True)
        self._client.will_set(self._topic + "status", will, qos=1, retain=True)
        self._client.on_connect = self._on_connect
        self._client.on_connect_fail = self._on_connect_fail
        self._client.on_disconnect = self._on_disconnect
        self._client.on_publish = self._on_publish
        self._client.on_message = self._on_message
        self._broker = broker
        self._is_broken_off = False
        self._answer: bool | None = None  # of the broker on this connection: it has accepted or refused us
        self._sent: dict[int, str] = {}  # by message id, what the broker has not acknowledged
        self._tried: set[str] = set()  # kinds of QoS 0 that the broker was asked about on this connection
        self._pauses: tuple[float, float] | None = None
        self._retry(RETRY)

    def start(self) -> None:
        """Connect, and again for as long as it takes, in paho's own thread."""
        self._client.connect_async(self._broker.host, self._broker.port, keepalive=KEEP_ALIVE)
        self._client.loop_start()

    def publish(self, kind: str, payload: bytes) -> None:
        """Send a report; what cannot be sent now is dropped by paho or the caller, never blocks."""
        qos = REPORTS[kind]
        if self._client.speaks_5 and kind not in self._tried:  # only for QoS 1 a broker says that its ACL denies it
            self._tried.add(kind)
            qos = 1
        with self._client.written_here():
            sent = self._client.publish(self._topic + kind, payload, qos=qos, retain=kind == "status")
            if len(self._sent) >= MOST_UNANSWERED:
                self._sent.clear()
            self._sent[sent.mid] = kind

    def subscribe(self) -> None:
        """To everything that is sent to the device; once more changes nothing where the broker knows of it."""
        self._client.subscribe([(self._topic + kind, qos) for kind, qos in COMMANDS.items()])

    def close(self, offline_status: bytes) -> None:
        """Leave a retained status behind and end; waits at most a second for the broker."""
        if self._client.is_connected():
            sent = self._client.publish(self._topic + "status", offline_status, qos=1, retain=True)
            try:
                sent.wait_for_publish(timeout=1.0)
            except RuntimeError as error:
                log.warning("the broker did not take our last status: %s", error)
        self._client.disconnect()
        self._client.loop_stop()

    def break_off(self) -> None:
        """Disconnects without a status, as a device that loses power or Wi-Fi; the broker sends the last will."""
        self._is_broken_off = True
        wire = self._client.socket()
        if isinstance(wire, socket.socket):
            with contextlib.suppress(OSError):
                wire.shutdown(socket.SHUT_RDWR)
        self._client.disconnect()
        # Its thread may be about to connect, and the steps cannot wait for that.
        threading.Thread(target=self._client.loop_stop, daemon=True).start()

    def _put(self, item: Item) -> None:
        if not self._is_broken_off:
            self._inbox.put(item)

    def _retry(self, pauses: tuple[float, float]) -> None:
        """Shortest and longest pause between attempts [s]; it doubles from one to the other."""
        if pauses != self._pauses:
            self._pauses = pauses
            self._client.reconnect_delay_set(*pauses)  # type: ignore[arg-type]

    def _on_connect(self, _client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        self._answer = not is_failure(reason)
        if self._answer:
            self._retry(RETRY)
            self._tried.clear()
            self.subscribe()
            self._put(Connected())
        elif self._client.speaks_5 and code_of(reason) == OLD_BROKER:
            self._client.speak_older()
        else:
            self._retry(RETRY_REFUSED)
            self._put(Disconnected(str(refusal(code_of(reason), str(reason), self._broker))))

    def _on_connect_fail(self, client: paho.Client, _data: object) -> None:
        error = self._client.failure or OSError("no connection")
        self._retry(RETRY_REFUSED if needs_a_person(error) else RETRY)
        self._put(Disconnected(str(failure(error, self._broker))))

    def _on_disconnect(self, _client: paho.Client, _data: object, _flags: object, reason: object, _p: object) -> None:
        answer, self._answer = self._answer, None
        if answer or code_of(reason) == NO_ANSWER:
            self._put(Disconnected(str(reason)))
        elif answer is None:
            self._retry(RETRY_REFUSED)
            error = self._client.failure
            self._put(Disconnected(str(failure(error, self._broker) if error else silence(self._broker))))

    def _on_publish(self, _client: paho.Client, _data: object, message_id: int, reason: object, _props: object) -> None:
        kind = self._sent.pop(message_id, None)
        if is_failure(reason) and kind is not None:
            self._put(Denied(str(denial(self._topic + kind, self._broker))))

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        arrival = time.monotonic()
        # A flood may fill the memory but not starve the steps.
        if self._inbox.qsize() > FULL_INBOX:
            return
        kind, payload = message.topic.removeprefix(self._topic), bytes(message.payload)
        self._put(MqttMessage(kind, payload if _fits(kind, payload) else b"", message.retain, arrival))


def _fits(kind: str, payload: bytes) -> bool:
    if kind not in FRAME_TYPES:
        return len(payload) <= LARGEST
    return 3 <= len(payload) <= LARGEST and payload[2] == FRAME_TYPES[kind]
