"""MQTT to the device: one fresh client per connection, so that nothing outlives one.

A new connection starts with empty queues by construction; while there is none, `send` refuses.
paho's threads only put into a bounded inbox and wake the node.
"""

from __future__ import annotations

import contextlib
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterable

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode

from services.stepper_gateway.links.connection import ReceiveQueue, keep_connected
from services.stepper_gateway.links.link import FROM_DEVICE, Kind, Received

PREFIX = "gemelo/v1"
UNACKNOWLEDGED = (Kind.HB, Kind.SYNC, Kind.SYNC_R, Kind.TRAJ_ACK, Kind.STATE, Kind.SENSORS, Kind.SHAFT)  # QoS 0
MAX_PAYLOAD = 65_536  # [bytes] no frame of the device comes near
CONNECT_TIMEOUT = 2.0  # [s]
KEEP_ALIVE = 5  # [s]


class DirectClient(paho.Client):
    """A client whose caller writes to the socket itself, before paho's thread would.

    paho's thread has to be woken and to wait for its turn among the threads of the process: in a flood tens of
    milliseconds. It still writes what the socket did not take at once, and handles every error.
    """

    def __init__(self, client_id: str) -> None:
        super().__init__(
            CallbackAPIVersion.VERSION2,
            client_id=client_id,
            clean_session=True,
            protocol=paho.MQTTv311,
            reconnect_on_failure=False,
        )
        self._writing = threading.RLock()  # two that write parts of frames would mix them

    def write_now(self) -> None:
        """Writes what is queued, as far as the socket takes it without blocking; from any thread."""
        with self._writing:
            self._packet_write()

    def loop_write(self) -> MQTTErrorCode:
        """As paho's; its thread calls it."""
        with self._writing:
            return super().loop_write()


class MqttLink:
    """A link to one device through one broker; connects and reconnects in a thread of its own."""

    def __init__(self, host: str, port: int, device: str, wake: Callable[[], None]) -> None:
        self._address = (host, port)
        self._prefix = f"{PREFIX}/{device}/"
        self._wake = wake
        self._inbox = ReceiveQueue(wake)
        self._client: DirectClient | None = None
        self._reason = f"no connection yet to the MQTT broker at {host}:{port}"
        self._lost = threading.Event()
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=keep_connected, args=(self._connection, self._stop), name="mqtt-link", daemon=True
        )
        self._thread.start()

    @property
    def connected(self) -> bool:
        return self._client is not None

    @property
    def reason(self) -> str:
        return "" if self._client is not None else self._reason

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        """All is sent at once, so nothing waits that an urgent payload could overtake."""
        client = self._client
        if client is None:
            return False
        # The newest configuration replaces what any gateway before us has left at the broker.
        retain = kind is Kind.CONFIG
        queued = client.publish(self._prefix + kind, payload, _qos(kind), retain)
        client.write_now()
        return queued.rc == paho.MQTT_ERR_SUCCESS

    def take(self, most: int) -> list[Received]:
        return self._inbox.take(most)

    def close(self) -> None:
        self._stop.set()
        self._lost.set()
        self._thread.join(timeout=CONNECT_TIMEOUT + 2.0)

    def _connection(self) -> bool:
        """One connection from beginning to end; true if there was one."""
        host, port = self._address
        self._lost.clear()
        client = self._new_client()
        try:
            client.connect(host, port, keepalive=KEEP_ALIVE)
        except OSError as error:
            self._lose(f"no MQTT broker answers at {host}:{port} ({error}): is the process `broker` running?")
            return False
        client.loop_start()
        self._lost.wait()
        was_connected = self._client is not None
        self._client = None
        with contextlib.suppress(OSError, ValueError):
            client.disconnect()
        client.loop_stop()
        self._client = None  # a late answer of the broker may have set it once more
        return was_connected

    def _new_client(self) -> DirectClient:
        client = DirectClient(f"gemelo-gateway-{secrets.token_hex(6)}")
        client.connect_timeout = CONNECT_TIMEOUT
        client.max_inflight_messages_set(0)  # no limit: a stop must not wait until a broker has acknowledged others
        client.on_socket_open = _send_at_once
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.on_disconnect = self._on_disconnect
        client.on_message = self._on_message
        return client

    def _on_connect(self, client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        if getattr(reason, "is_failure", False):
            self._lose(f"the MQTT broker at {self._address[0]}:{self._address[1]} refuses us: {reason}")
            return
        client.subscribe([(self._prefix + kind, _qos(kind)) for kind in FROM_DEVICE])

    def _on_subscribe(
        self, client: paho.Client, _data: object, _id: int, reasons: Iterable[object], _props: object
    ) -> None:
        """Only now nothing that the device answers can be missed."""
        if any(getattr(reason, "is_failure", False) for reason in reasons):
            self._lose(f"the MQTT broker at {self._address[0]}:{self._address[1]} lets us hear nothing: see its ACL")
            return
        assert isinstance(client, DirectClient)  # ours, see `_new_client`
        self._client = client
        self._wake()

    def _on_disconnect(
        self, _client: paho.Client, _data: object, _flags: object, reason: object, _props: object
    ) -> None:
        self._lose(f"the connection to the MQTT broker at {self._address[0]}:{self._address[1]} is lost ({reason})")

    def _lose(self, reason: str) -> None:
        self._reason = reason
        self._lost.set()
        self._wake()

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        arrival = time.monotonic_ns()
        # What is too long for any frame comes as no bytes at all: it is counted with the other bad ones.
        payload = bytes(message.payload) if len(message.payload) <= MAX_PAYLOAD else b""
        try:
            kind = Kind(message.topic.removeprefix(self._prefix))
        except ValueError:
            return
        self._inbox.put(Received(kind, payload, message.retain, arrival))


def _qos(kind: Kind) -> int:
    return 0 if kind in UNACKNOWLEDGED else 1


def _send_at_once(_client: paho.Client, _data: object, sock: object) -> None:
    # Without it Nagle's algorithm and delayed acknowledgements cost 20 to 40 ms a frame.
    if isinstance(sock, socket.socket):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
