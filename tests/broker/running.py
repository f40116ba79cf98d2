"""A gemelo-broker as its own process, and its clients."""

from __future__ import annotations

import os
import queue
import socket
import ssl
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import paho.mqtt.client as mqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.stack.stack import free_ports
from tests.optional import need

BROKERS = ("embedded", "mosquitto")
VERSIONS = {"3.1.1": mqtt.MQTTv311, "5": mqtt.MQTTv5}
PATIENCE = 60.0  # [s]
FOR_EVER = 0xFFFFFFFF  # a session's expiry interval of MQTT 5


def wait_until(condition: Callable[[], object], timeout: float = PATIENCE) -> None:
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, f"waited {timeout:g} s"
        time.sleep(0.01)


class RunningBroker:
    """A gemelo-broker of its own port and folder; `settings` are keys of [mqtt]."""

    def __init__(self, broker: str, folder: Path, port: int | None = None, **settings: object) -> None:
        if broker == "mosquitto":
            need("mosquitto")
        self.name, self.folder = broker, folder
        self.port = port or free_ports(1)[0]
        self.ready = folder / "run/broker.ready"
        folder.mkdir(parents=True, exist_ok=True)
        self._log = folder / "broker.log"
        own = {"broker": broker, "port": self.port, **settings}
        self._environment = os.environ | {f"GEMELO_MQTT_{key.upper()}": str(value) for key, value in own.items()}
        self._environment["GEMELO_PATHS_RUN"] = str(folder / "run")
        self.start()

    def start(self) -> None:
        """Starts it, on the same port every time."""
        command = [sys.executable, "-m", "gemelo.services.broker.main"]
        with self._log.open("a") as log:
            self.popen = subprocess.Popen(command, cwd=project_root(), env=self._environment, stdout=log, stderr=log)

    @property
    def output(self) -> str:
        return self._log.read_text()

    def wait_ready(self) -> RunningBroker:
        wait_until(lambda: self.ready.exists() or self.popen.poll() is not None)
        assert self.popen.poll() is None, self.output
        return self

    def stop(self) -> str:
        """Ends it if it still runs; all that it has printed."""
        if self.popen.poll() is None:
            self.popen.terminate()
        self.popen.wait(timeout=60.0)
        return self.output

    def restart(self, kill: bool = False) -> None:
        self.popen.kill() if kill else self.popen.terminate()
        self.popen.wait(timeout=60.0)
        wait_until(lambda: not self.ready.exists())
        self.start()
        self.wait_ready()


class Client:
    """A client by paho whose answers are waited for; `keeps` its session, `will` is (topic, payload, is retained)."""

    def __init__(
        self,
        port: int,
        name: str = "",
        version: str = "5",
        *,
        keeps: bool = False,
        will: tuple[str, str, bool] | None = None,
        user: tuple[str, str] | None = None,
        tls: ssl.SSLContext | None = None,
        comes_back: bool = False,
        topics: tuple[str, ...] = (),
    ) -> None:
        is_5 = version == "5"
        self.paho = mqtt.Client(
            mqtt.CallbackAPIVersion.VERSION2, name, protocol=VERSIONS[version],
            clean_session=None if is_5 else not keeps, reconnect_on_failure=comes_back,
        )  # fmt: skip
        self.answers: queue.Queue[int] = queue.Queue()  # the codes of CONNACK
        self.ends: queue.Queue[int] = queue.Queue()  # the codes of each lost connection
        self.messages: queue.Queue[mqtt.MQTTMessage] = queue.Queue()
        self.has_session = False
        self._acknowledged: queue.Queue[int] = queue.Queue()
        self._subscribed: queue.Queue[int] = queue.Queue()
        self._topics = topics
        self.paho.on_connect = self._on_connect
        self.paho.on_disconnect = lambda _c, _d, _flags, code, _p: self.ends.put(code.value)
        self.paho.on_message = lambda _c, _d, message: self.messages.put(message)
        self.paho.on_publish = lambda _c, _d, _mid, code, _p: self._acknowledged.put(code.value)
        self.paho.on_subscribe = lambda _c, _d, _mid, codes, _p: self._subscribed.put(codes[0].value)
        self.paho.on_socket_open = lambda _c, _d, sock: sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.paho.reconnect_delay_set(1, 1)
        if will:
            self.paho.will_set(will[0], will[1], qos=1, retain=will[2])
        if user:
            self.paho.username_pw_set(*user)
        if tls:
            self.paho.tls_set_context(tls)
        properties = None
        if is_5:
            properties = Properties(PacketTypes.CONNECT)
            properties.SessionExpiryInterval = FOR_EVER if keeps else 0
        starts_anew = not keeps if is_5 else mqtt.MQTT_CLEAN_START_FIRST_ONLY
        self.paho.connect("127.0.0.1", port, clean_start=starts_anew, properties=properties)
        self.paho.loop_start()

    def _on_connect(self, _c: object, _d: object, flags: mqtt.ConnectFlags, code: object, _p: object) -> None:
        self.has_session = flags.session_present
        for topic in self._topics:
            self.paho.subscribe(topic, qos=1)
        self.answers.put(code.value)  # type: ignore[attr-defined]

    def connected(self) -> Client:
        """Waits until it is, and has subscribed to its own topics."""
        assert self.answers.get(timeout=PATIENCE) == 0
        for _ in self._topics:
            assert self._subscribed.get(timeout=PATIENCE) < 0x80
        return self

    def subscribe(self, topic: str, qos: int = 1) -> int:
        """The code of SUBACK."""
        self.paho.subscribe(topic, qos=qos)
        return self._subscribed.get(timeout=PATIENCE)

    def publish(self, topic: str, payload: str | bytes, qos: int = 1, retain: bool = False) -> int:
        """The code of PUBACK; 0 where the version has none."""
        self.paho.publish(topic, payload, qos=qos, retain=retain)
        return self._acknowledged.get(timeout=PATIENCE)

    def next(self, timeout: float = PATIENCE) -> tuple[str, str]:
        """Topic and payload of the next message."""
        message = self.messages.get(timeout=timeout)
        return message.topic, message.payload.decode()

    def hears(self, sender: Client, topic: str) -> bool:
        """What `sender` publishes to it arrives, whatever came before."""
        mark = f"mark {time.monotonic_ns()}"
        sender.publish(topic, mark)
        end = time.monotonic() + PATIENCE
        while self.next(max(0.01, end - time.monotonic())) != (topic, mark):
            pass
        return True

    def cut(self) -> None:
        """Ends the connection without a word, as a client that dies."""
        wire = self.paho.socket()
        assert wire is not None
        self.paho.reconnect_delay_set(1, 1)
        wire.shutdown(socket.SHUT_RDWR)
        self.ends.get(timeout=PATIENCE)

    def close(self) -> None:
        self.paho.disconnect()
        stop_loop(self.paho)
