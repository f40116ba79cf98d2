"""Bytes from a broker that are no MQTT end the connection, and never the thread that reads: it is made anew."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import MqttClient
from tests.profiles import examples
from tests.runtime.support import until

CONNACK, SUBACK = b"\x20\x02\x00\x00", b"\x90\x03\x00\x01\x00"
GOOD = b"well"


def publish(topic: bytes, payload: bytes) -> bytes:
    body = struct.pack("!H", len(topic)) + topic + payload
    return bytes([0x30, len(body)]) + body


class Broker:
    """Says `bad` on the first connection, and something good on every later one."""

    def __init__(self, bad: bytes, *, hangs_up: bool) -> None:
        self._bad, self._hangs_up = bad, hangs_up
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.connections = 0
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        open_ones = []
        while True:
            try:
                wire, _ = self._listening.accept()
            except OSError:
                break
            self.connections += 1
            wire.recv(1024)
            wire.sendall(CONNACK + (self._bad if self.connections == 1 else publish(b"a/b", GOOD)))
            if self.connections == 1 and self._hangs_up:
                wire.close()
            open_ones.append(wire)
        for wire in open_ones:
            wire.close()

    def close(self) -> None:
        self._listening.close()


@contextmanager
def listening_to(broker: Broker) -> Iterator[list[tuple[str, bytes]]]:
    """What a client hears that is connected for as long as the block lasts."""
    heard: list[tuple[str, bytes]] = []
    client = MqttClient(BrokerAccess("127.0.0.1", broker.port), "reader", speaks_5=False, reconnect_on_failure=True)
    client.on_message = lambda _client, _data, message: heard.append((message.topic, bytes(message.payload)))
    client.reconnect_delay_set(0.01, 0.01)  # type: ignore[arg-type]
    client.connect_async("127.0.0.1", broker.port)
    client.loop_start()
    try:
        yield heard
    finally:
        client.disconnect()
        client.loop_stop()


@pytest.mark.parametrize(
    "bad",
    [publish(b"a/\xb1", b"x"), b"\x30\x03\x00\x09a", b"\x30\x01\x00", b"\x40\x01\x00", b"\x00\x00", b"\x20\x00",
     b"\x30\xff\xff\xff\xff\xff", b"\x36\x07\x00\x03a/b\x00\x01"],
    ids=["topic no UTF-8", "topic longer than the packet", "half a length", "half an acknowledgement", "no type",
         "empty CONNACK", "length without an end", "QoS 3"],
)  # fmt: skip
def test_a_packet_that_is_none_ends_the_connection_and_the_next_one_is_read(bad: bytes) -> None:
    with closing(Broker(bad, hangs_up=False)) as broker, listening_to(broker) as heard:
        assert until(lambda: ("a/b", GOOD) in heard, 60.0), (broker.connections, heard)
        assert broker.connections == 2


@examples(quick=15, full=40)
@given(bad=st.binary(max_size=60))
def test_whatever_bytes_come_the_client_comes_back(bad: bytes) -> None:
    with closing(Broker(bad, hangs_up=True)) as broker, listening_to(broker) as heard:
        assert until(lambda: ("a/b", GOOD) in heard, 60.0), (broker.connections, heard)


class EndingClient(MqttClient):
    """Its thread ends, and paho's takes itself away, just after it was seen to be there."""

    looks = 0

    @property
    def _thread(self) -> threading.Thread | None:
        self.looks += 1
        return threading.Thread() if self.looks < 3 else None

    @_thread.setter
    def _thread(self, thread: threading.Thread | None) -> None: ...


def test_a_thread_that_ends_just_as_it_is_waited_for_is_no_error() -> None:
    client = EndingClient(BrokerAccess("127.0.0.1", 1), "ending")
    client.looks = 0
    client.loop_stop()
    assert client.looks == 3
