"""The virtual ESP32's MQTT: paho's thread only puts into an inbox, with the time of arrival."""

from __future__ import annotations

import contextlib
import logging
import queue
import socket
import ssl
import threading
import time
from dataclasses import dataclass, field

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

log = logging.getLogger("virtual_esp32")

PREFIX = "gemelo/v1"
COMMANDS = {"traj": 1, "cmd": 1, "hb": 0, "sync": 0, "config": 1, "inject": 1}  # QoS of the subscription
REPORTS = {  # QoS of the publication
    "traj/ack": 0, "cmd/ack": 1, "sync/r": 0, "state": 0, "event": 1, "status": 1,
    "config/ack": 1, "sensors": 0, "shaft": 0,
}  # fmt: skip
FRAME_TYPES = {"traj": 1, "cmd": 3, "hb": 5, "sync": 6}
LARGEST = 16_384  # [bytes] the largest chunk has 8,228
FULL_INBOX = 4096  # [messages]
KEEP_ALIVE = 5  # [s]


@dataclass(frozen=True)
class BrokerAddress:
    """The address, credentials and TLS context of a broker."""

    host: str
    port: int
    user: str = ""
    password: str = field(default="", repr=False)
    tls: ssl.SSLContext | None = None


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
class ShutdownRequested:
    """The process is asked to end."""


Item = MqttMessage | SerialBytes | Connected | Disconnected | ShutdownRequested


class DeviceLink:
    """One device's topics at one broker."""

    def __init__(self, broker: BrokerAddress, device: str, will: bytes, inbox: queue.SimpleQueue[Item]) -> None:
        self._topic = f"{PREFIX}/{device}/"
        self._inbox = inbox
        self._client = paho.Client(
            CallbackAPIVersion.VERSION2,
            client_id=f"gemelo-device-{device}",
            clean_session=True,
            protocol=paho.MQTTv311,
        )
        self._client.will_set(self._topic + "status", will, qos=1, retain=True)
        if broker.user:
            self._client.username_pw_set(broker.user, broker.password)
        if broker.tls is not None:
            self._client.tls_set_context(broker.tls)
        self._is_broken_off = False
        self._client.on_socket_open = _send_at_once
        self._client.on_connect = self._on_connect
        self._client.on_connect_fail = self._on_connect_fail
        self._client.on_disconnect = self._on_disconnect
        self._client.on_message = self._on_message
        self._client.connect_timeout = 2.0
        self._client.reconnect_delay_set(min_delay=0.2, max_delay=1.0)  # type: ignore[arg-type]
        self._broker = broker

    def start(self) -> None:
        """Connect, and again for as long as it takes, in paho's own thread."""
        self._client.connect_async(self._broker.host, self._broker.port, keepalive=KEEP_ALIVE)
        self._client.loop_start()

    def publish(self, kind: str, payload: bytes) -> None:
        """Send a report; what cannot be sent now is dropped by paho or the caller, never blocks."""
        self._client.publish(self._topic + kind, payload, qos=REPORTS[kind], retain=kind == "status")

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

    def _on_connect(self, client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        if getattr(reason, "is_failure", False):
            self._put(Disconnected(f"the broker refuses us: {reason}"))
            return
        client.subscribe([(self._topic + kind, qos) for kind, qos in COMMANDS.items()])
        self._put(Connected())

    def _on_connect_fail(self, _client: paho.Client, _data: object) -> None:
        where = f"{self._broker.host}:{self._broker.port}"
        self._put(Disconnected(f"no MQTT broker answers at {where}; is the process `broker` running?"))

    def _on_disconnect(self, _client: paho.Client, _data: object, _flags: object, reason: object, _p: object) -> None:
        self._put(Disconnected(str(reason)))

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


def _send_at_once(_client: paho.Client, _data: object, sock: object) -> None:
    # Without it Nagle's algorithm and delayed acknowledgements cost 20 to 40 ms a frame.
    if isinstance(sock, socket.socket):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
