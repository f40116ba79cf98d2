"""A virtual sketch in real time: what `gemelo-virtual-esp32` is where robot.toml has `dialect = "ra"`."""

from __future__ import annotations

import logging
import queue
import time

from paho.mqtt import client as paho

from gemelo.firmware.platform.host.link import Item, MqttMessage, ShutdownRequested
from gemelo.firmware.platform.host.sketch import HostSketch
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.motors.relative_moves import ramp_of
from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import MqttClient
from gemelo.libraries.runtime.process.readiness import Readiness

log = logging.getLogger("virtual_esp32")

JOINTS = "ra/juntas"
PAUSE = 0.01  # [s] between two looks at the clock
BEAT = 1.0  # [s] of the readiness file


class VirtualSketch:
    """One sketch on one broker; its shafts start at zero, wherever the arm is believed to be."""

    def __init__(
        self, arm: ArmDescription, broker: BrokerAccess, inbox: queue.SimpleQueue[Item], readiness: Readiness
    ) -> None:
        ramps = [ramp_of(joint.drive) for joint in arm.joints]
        self.sketch = HostSketch(ramps, telemetry_time=arm.device.telemetry_time)
        self._inbox, self._readiness = inbox, readiness
        self._broker = broker
        self._client = MqttClient(broker, "", speaks_5=False, reconnect_on_failure=True)
        self._client.on_connect = self._on_connect
        self._client.on_message = self._on_message
        self._switched_on = time.monotonic()
        self._next_beat = 0.0

    def run(self) -> None:
        """Until a ShutdownRequested arrives in the inbox."""
        self._client.connect_async(self._broker.host, self._broker.port, keepalive=5)
        self._client.loop_start()
        while self._hear():
            now = time.monotonic()
            for topic, payload in self.sketch.advance(now - self._switched_on):
                self._client.publish(topic, payload, qos=0, retain=topic == "ra/estados")
            self._beat(now)
        self._readiness.not_ready()
        log.info("the sketch's shafts stand at %s steps after %d messages", self.sketch.shafts, self.sketch.moves)
        self._client.disconnect()
        self._client.loop_stop()

    def _hear(self) -> bool:
        """False at the end."""
        try:
            item = self._inbox.get(timeout=PAUSE)
        except queue.Empty:
            return True
        if isinstance(item, MqttMessage):
            self.sketch.receive(item.payload)
        return not isinstance(item, ShutdownRequested)

    def _beat(self, now: float) -> None:
        is_connected = self._client.is_connected()
        if now < self._next_beat and is_connected == self._readiness.is_ready:
            return
        self._next_beat = now + BEAT
        if is_connected:
            self._readiness.ready()
        else:
            self._readiness.not_ready("no connection to the broker")
        self._readiness.beat()

    def _on_connect(self, client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        if not getattr(reason, "is_failure", False):
            client.subscribe(JOINTS, 0)
            log.info("a virtual sketch listens on %s", JOINTS)

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        self._inbox.put(MqttMessage(message.topic, bytes(message.payload), message.retain, time.monotonic()))
