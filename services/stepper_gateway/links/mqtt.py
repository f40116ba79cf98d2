"""MQTT to the device: one fresh client per connection, so that nothing outlives one.

A new connection starts with empty queues by construction; while there is none, `send` refuses.
paho's threads only put into a bounded inbox and wake the node.
"""

from __future__ import annotations

import contextlib
import secrets
import threading
import time
from collections.abc import Callable, Iterable

from paho.mqtt import client as paho

from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import NO_ANSWER, OLD_BROKER, MqttClient, code_of, is_failure
from gemelo.libraries.mqtt.failures import denial, failure, needs_a_person, refusal, silence
from gemelo.schemas.device_topics import topic
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.connection import ReceiveQueue, keep_connected
from gemelo.services.stepper_gateway.links.link import FROM_DEVICE, Kind, Received

UNACKNOWLEDGED = (Kind.HB, Kind.SYNC, Kind.SYNC_R, Kind.TRAJ_ACK, Kind.STATE, Kind.SENSORS, Kind.SHAFT)  # QoS 0
DISPENSABLE = (Kind.INJECT, Kind.CONFIG)  # whoever asks for these hears that the device did not answer
MAX_PAYLOAD = 65_536  # [bytes] chosen: no frame of the device comes near
KEEP_ALIVE = 5  # [s] chosen: a dead broker is noticed in 7.5 s where no heartbeat tells it before
# Between attempts after a refusal, which only a person can mend.
REFUSED = (1.0, 2.0, 4.0, 8.0, 16.0)  # [s] chosen: no flood, and no long wait for a person who has mended it
MOST_UNANSWERED = 1024  # [messages] whose topic is remembered for the broker's answer; chosen: some seconds of ours


class MqttLink:
    """A link to one device through one broker; connects and reconnects in a thread of its own."""

    def __init__(self, access: BrokerAccess, device: str, wake: Callable[[], None]) -> None:
        self._access = access
        self._device = device
        self._prefix = topic(device, "")
        self._wake = wake
        self._inbox = ReceiveQueue(wake)
        self._client: MqttClient | None = None
        self._reason = because("link.none_yet_to", access=str(access))
        self._speaks_5 = True
        self._was_answered = False  # on this connection
        self._refusals = 0  # in a row
        self._sent: dict[int, Kind] = {}  # by message id, what the broker has not acknowledged
        self._tried: set[Kind] = set()  # kinds of QoS 0 that the broker was asked about on this connection
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
    def reason(self) -> Reason | None:
        return None if self._client is not None else self._reason

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        """All is sent at once, so nothing waits that an urgent payload could overtake."""
        client = self._client
        if client is None:
            return False
        # The newest configuration replaces what any gateway before us has left at the broker.
        retain = kind is Kind.CONFIG
        queued = client.publish(self._prefix + kind, payload, self._qos_to_send(client, kind), retain)
        self._remember(queued.mid, kind)
        client.write_now()
        return queued.rc == paho.MQTT_ERR_SUCCESS

    def take(self, most: int) -> list[Received]:
        return self._inbox.take(most)

    def close(self) -> None:
        self._stop.set()
        self._lost.set()
        self._thread.join(timeout=4.0)

    def _qos_to_send(self, client: MqttClient, kind: Kind) -> int:
        """A broker says only for QoS 1 that its ACL denies a message: the first of every kind asks for that."""
        if not client.speaks_5 or kind in self._tried:
            return _qos(kind)
        self._tried.add(kind)
        return 1

    def _remember(self, message_id: int, kind: Kind) -> None:
        if len(self._sent) >= MOST_UNANSWERED:
            self._sent.clear()
        self._sent[message_id] = kind

    def _connection(self) -> bool:
        """One connection from beginning to end; true if there was one."""
        self._lost.clear()
        self._sent.clear()
        self._tried.clear()
        self._was_answered = False
        refusals = self._refusals
        client = self._new_client()
        try:
            client.connect(self._access.host, self._access.port, keepalive=KEEP_ALIVE)
            client.loop_start()
        except OSError as error:
            self._refusals += needs_a_person(error)
            self._lose(failure(error, self._access))
            return self._after(refusals, False)
        self._lost.wait()
        was_connected = self._client is not None
        self._client = None
        with contextlib.suppress(OSError, ValueError):
            client.disconnect()
        client.loop_stop()
        self._client = None  # a late answer of the broker may have set it once more
        return self._after(refusals, was_connected)

    def _after(self, refusals: int, was_connected: bool) -> bool:
        """Waits ever longer after refusals in a row; anything else ends the row."""
        if self._refusals > refusals:
            self._stop.wait(REFUSED[min(refusals, len(REFUSED) - 1)])
        else:
            self._refusals = 0
        return was_connected

    def _new_client(self) -> MqttClient:
        client = MqttClient(self._access, f"gemelo-gateway-{secrets.token_hex(6)}", speaks_5=self._speaks_5)
        client.max_inflight_messages_set(0)  # no limit: a stop must not wait until a broker has acknowledged others
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.on_publish = self._on_publish
        client.on_disconnect = self._on_disconnect
        client.on_message = self._on_message
        return client

    def _on_connect(self, client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        self._was_answered = True
        if not is_failure(reason):
            client.subscribe([(self._prefix + kind, _qos(kind)) for kind in FROM_DEVICE])
        elif self._speaks_5 and code_of(reason) == OLD_BROKER:
            self._speaks_5 = False
            self._lose(because("link.old_mqtt", access=str(self._access)))
        else:
            self._refuse(refusal(code_of(reason), str(reason), self._access))

    def _on_subscribe(
        self, client: paho.Client, _data: object, _id: int, reasons: Iterable[object], _props: object
    ) -> None:
        """Only now nothing that the device answers can be missed."""
        denied = [kind for kind, reason in zip(FROM_DEVICE, reasons, strict=False) if is_failure(reason)]
        if denied:
            self._refuse(denial(self._prefix + denied[0], self._access, "read"))
            return
        assert isinstance(client, MqttClient)  # ours, see `_new_client`
        self._client = client
        self._wake()

    def _on_publish(self, _client: paho.Client, _data: object, message_id: int, reason: object, _props: object) -> None:
        """The broker has taken a message, or its ACL denies it: then the device must not be believed reachable."""
        kind = self._sent.pop(message_id, None)
        if is_failure(reason) and kind is not None and kind not in DISPENSABLE:
            self._refuse(denial(self._prefix + kind, self._access))

    def _on_disconnect(
        self, client: paho.Client, _data: object, _flags: object, reason: object, _props: object
    ) -> None:
        assert isinstance(client, MqttClient)
        if self._was_answered or code_of(reason) == NO_ANSWER:
            self._lose(because("link.lost", access=str(self._access), error=str(reason)))
        elif client.failure is not None:
            self._refuse(failure(client.failure, self._access))
        else:
            self._speaks_5 = not self._speaks_5  # some old brokers only hang up on a version that they do not know
            self._refuse(silence(self._access))

    def _refuse(self, reason: Reason) -> None:
        if not self._lost.is_set():
            self._refusals += 1
        self._lose(reason)

    def _lose(self, reason: Reason) -> None:
        """The first reason counts: what comes after it follows from it."""
        if self._lost.is_set():
            return
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
