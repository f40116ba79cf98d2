"""MQTT to a sketch: `ra/juntas` out, `ra/estados` and `ra/sensores` in, one fresh client per connection.

`ra/juntas` is read too: what another program sends there moves the arm as well.
"""

from __future__ import annotations

import contextlib
import secrets
import threading
import time
from collections.abc import Callable
from functools import partial

from paho.mqtt import client as paho

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import CONNECT_TIMEOUT, MqttClient, code_of, is_failure
from gemelo.libraries.mqtt.failures import failure, refusal
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.connection import keep_connected
from gemelo.services.stepper_gateway.links.foreign import ra_messages
from gemelo.services.stepper_gateway.links.foreign.adapter import Adapter, ForeignCall, FrameFor
from gemelo.services.stepper_gateway.links.foreign.ra_device import RaDevice
from gemelo.services.stepper_gateway.links.link import Kind, Received
from gemelo.services.stepper_gateway.links.mqtt import KEEP_ALIVE


class RaLink:
    """A link to the one sketch behind a broker."""

    def __init__(self, access: BrokerAccess, arm: ArmDescription, wake: Callable[[], None]) -> None:
        self._access, self._wake = access, wake
        self._client: MqttClient | None = None
        self._reason = because("link.none_yet_to", access=str(access))
        self._lost, self._stop = threading.Event(), threading.Event()
        self._device = RaDevice(arm, lambda: secrets.randbelow((1 << 32) - 1) + 1, time.monotonic())
        self._adapter = Adapter(self._device, self._write, wake)
        self._thread = threading.Thread(
            target=keep_connected, args=(self._connection, self._stop), name="ra-link", daemon=True
        )
        self._thread.start()

    @property
    def connected(self) -> bool:
        return self._client is not None

    @property
    def reason(self) -> Reason | None:
        return None if self.connected else self._reason

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        return self.connected and self._adapter.put(FrameFor(kind, payload))

    def take(self, most: int) -> list[Received]:
        return self._adapter.take(most)

    def close(self) -> None:
        self._stop.set()
        self._lost.set()
        self._thread.join(timeout=CONNECT_TIMEOUT + 2.0)
        self._adapter.close()

    def _write(self, payload: bytes) -> None:
        """QoS 1: the broker has it; whether the sketch has, only its telemetry lets one guess."""
        client = self._client
        if client is not None:
            client.publish(ra_messages.JOINTS, payload, qos=1)
            client.write_now()

    def _connection(self) -> bool:
        """One connection from beginning to end; true if there was one."""
        self._lost.clear()
        client = MqttClient(self._access, f"gemelo-ra-{secrets.token_hex(6)}", speaks_5=False)
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_message = self._on_message
        try:
            client.connect(self._access.host, self._access.port, keepalive=KEEP_ALIVE)
            client.loop_start()
        except OSError as error:
            self._lose(failure(error, self._access))
            return False
        self._lost.wait()
        was_connected, self._client = self._client is not None, None
        with contextlib.suppress(OSError, ValueError):
            client.disconnect()
        client.loop_stop()
        self._client = None
        return was_connected

    def _on_connect(self, client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        if is_failure(reason):
            return self._lose(refusal(code_of(reason), str(reason), self._access))
        client.subscribe([(ra_messages.STATES, 0), (ra_messages.SENSORS, 0), (ra_messages.JOINTS, 0)])
        assert isinstance(client, MqttClient)  # ours, see `_connection`
        self._client = client
        self._wake()

    def _on_disconnect(
        self, _client: paho.Client, _data: object, _flags: object, reason: object, _props: object
    ) -> None:
        self._lose(because("link.lost", access=str(self._access), error=str(reason)))

    def _lose(self, reason: Reason) -> None:
        self._reason = reason
        self._lost.set()
        self._wake()

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        topic, payload, retained = message.topic, bytes(message.payload), message.retain
        self._adapter.put(ForeignCall(partial(self._device.hear, topic, payload, retained)))
