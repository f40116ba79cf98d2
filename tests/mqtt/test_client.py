"""Bytes from a broker that are no MQTT end the connection, and never the thread that reads: it is made anew."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable, Iterator
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


class CountingBroker:
    """Takes one connection, and keeps what comes on it; `reads` once it may read."""

    def __init__(self) -> None:
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self.received = bytearray()
        self.reads = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        wire, _ = self._listening.accept()
        wire.recv(1024)
        wire.sendall(CONNACK)
        self.reads.wait()
        with wire:
            while data := wire.recv(65536):
                self.received += data

    def close(self) -> None:
        self.reads.set()
        self._listening.close()


@contextmanager
def writing_to(broker: CountingBroker) -> Iterator[tuple[MqttClient, Callable[[], int]]]:
    """A client that is connected for as long as the block lasts, and how often its thread was woken since."""
    client = MqttClient(BrokerAccess("127.0.0.1", broker.port), "writer", speaks_5=False)
    connected = threading.Event()
    client.on_connect = lambda *_: connected.set()
    client.connect("127.0.0.1", broker.port)
    client.loop_start()
    waker = client.waker
    assert waker is not None
    try:
        assert connected.wait(60.0)
        before = waker.count
        yield client, lambda: waker.count - before
    finally:
        client.disconnect()
        client.loop_stop()


def test_what_a_thread_writes_itself_wakes_no_other_and_all_comes_in_order() -> None:
    with closing(CountingBroker()) as broker, writing_to(broker) as (client, woken):
        broker.reads.set()
        for number in range(200):
            with client.written_here():
                client.publish("a/b", b"%03d" % number)
        assert woken() == 0
        sent = b"".join(publish(b"a/b", b"%03d" % number) for number in range(200))
        assert until(lambda: bytes(broker.received) == sent, 60.0)
        client.publish("a/b", b"by paho's thread")
        assert woken() > 0
        assert until(lambda: broker.received.endswith(b"by paho's thread"), 60.0)


def test_what_the_socket_does_not_take_at_once_is_written_by_pahos_thread() -> None:
    large = bytes(1_000_000)
    with closing(CountingBroker()) as broker, writing_to(broker) as (client, woken):
        for _ in range(20):
            with client.written_here():
                client.publish("a/b", large)
        assert woken() > 0, "the broker does not read yet"
        broker.reads.set()
        assert until(lambda: len(broker.received) > 20 * len(large), 60.0)


def test_another_threads_message_wakes_pahos_while_one_writes_itself() -> None:
    with closing(CountingBroker()) as broker, writing_to(broker) as (client, woken):
        broker.reads.set()
        with client.written_here():
            other = threading.Thread(target=lambda: client.publish("a/b", b"other"))
            other.start()
            other.join()
            assert woken() > 0
        assert until(lambda: broker.received.endswith(b"other"), 60.0)
