"""Strangers at either broker beside an honest client: half-open connections, garbage, clients that freeze."""

from __future__ import annotations

import random
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import psutil
import pytest

from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import tls_context
from tests.broker.running import Client, RunningBroker, wait_until

HALF_OPEN = 1000
HALF = b"\x10\x0c\x00\x04MQ"  # of a CONNECT
HUGE = b"\x10\xff\xff\xff\x7f"  # the beginning of one of 256 MiB
STRANGER = """
import resource, socket, sys
port, count, said = int(sys.argv[1]), int(sys.argv[2]), bytes.fromhex(sys.argv[3])
most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
links = []
for _ in range(count):
    links.append(socket.create_connection(("127.0.0.1", port)))
    try:
        links[-1].sendall(said)
    except OSError:  # it is one of the oldest already
        continue
print("open", flush=True)
sys.stdin.read()
"""
HANDSHAKE = 3.0  # [s] that the embedded broker gives it


@contextmanager
def half_open(port: int, said: bytes, count: int = HALF_OPEN) -> Iterator[None]:
    """Connections that say the beginning of a CONNECT and no more, from a process of their own: paho's client selects
    among descriptors up to 1024 only."""
    program = [sys.executable, "-c", STRANGER, str(port), str(count), said.hex()]
    with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as stranger:
        assert stranger.stdout is not None
        assert stranger.stdout.readline() == b"open\n"
        yield
        stranger.kill()


@pytest.mark.parametrize("said", [b"", HALF, HUGE], ids=["nothing", "half", "huge"])
def test_an_honest_client_works_and_another_joins_beside_a_thousand_that_never_finish(broker, join, topic, said):
    reader, sender = join(broker), join(broker)
    reader.subscribe(topic)
    memory = psutil.Process(broker.popen.pid).memory_info().rss
    with half_open(broker.port, said):
        assert reader.hears(sender, topic)
        late = join(broker)
        late.subscribe(topic)
        assert late.hears(sender, topic)
        assert reader.ends.empty()
        assert psutil.Process(broker.popen.pid).memory_info().rss - memory < 100e6
    assert reader.hears(sender, topic)


@pytest.mark.parametrize("is_locked", [False, True], ids=["open", "locked"])
def test_the_embedded_broker_ends_who_does_not_finish_connecting_and_has_its_descriptors_back(tmp_path, is_locked):
    settings = {}
    if is_locked:
        secure_folder.make(tmp_path / "lock", ["127.0.0.1"], ["rm1"])
        settings["secure_folder"] = tmp_path / "lock"
    running = RunningBroker("embedded", tmp_path, **settings).wait_ready()
    process = psutil.Process(running.popen.pid)
    before = process.num_fds()
    with half_open(running.port, b""):
        if is_locked:
            user = ("gateway", secure_folder.password_of(tmp_path / "lock", "gateway"))
            Client(running.port, user=user, tls=tls_context(str(tmp_path / "lock/ca.pem"))).connected().close()
        began = time.monotonic()
        wait_until(lambda: process.num_fds() <= before + 2)
        assert time.monotonic() - began < HANDSHAKE + 3.0
    running.stop()


def test_an_embedded_broker_without_descriptors_says_so_and_accepts_again(tmp_path, join, topic):
    running = RunningBroker("embedded", tmp_path).wait_ready()
    reader, sender = join(running), join(running)
    reader.subscribe(topic)
    few = psutil.Process(running.popen.pid).num_fds() + 20
    resource.prlimit(running.popen.pid, resource.RLIMIT_NOFILE, (few, few))
    with half_open(running.port, b"", 100):
        wait_until(lambda: "no connection can be accepted now" in running.output)
        assert reader.hears(sender, topic)
        late = join(running)  # the oldest of those that only connect give way
    late.subscribe(topic)
    assert late.hears(sender, topic)
    running.stop()


def test_garbage_ends_its_own_connection_and_nothing_else(broker, join, topic):
    """Random bytes, and packets of every type with random content, before and after a CONNECT."""
    chance = random.Random(7)
    reader, sender = join(broker), join(broker)
    reader.subscribe(topic)
    hello = b"\x10\x0c\x00\x04MQTT\x04\x02\x00\x05\x00\x00"
    for number in range(400):
        content = chance.randbytes(chance.randrange(100))
        packet = bytes([chance.randrange(256), len(content)]) + content
        with socket.create_connection(("127.0.0.1", broker.port)) as link:
            link.sendall((hello if number % 2 else b"") + packet + chance.randbytes(chance.randrange(20)))
    assert reader.hears(sender, topic)
    assert broker.popen.poll() is None
    assert reader.ends.empty()


def frozen(port: int, name: str, topic: str) -> socket.socket:
    """A client that subscribes, and reads no more."""
    link = socket.socket()
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    link.connect(("127.0.0.1", port))
    who = len(name).to_bytes(2) + name.encode()
    link.sendall(b"\x10" + bytes([10 + len(who)]) + b"\x00\x04MQTT\x04\x02\x00\x00" + who)
    assert link.recv(4) == b"\x20\x02\x00\x00"
    what = len(topic).to_bytes(2) + topic.encode()
    link.sendall(b"\x82" + bytes([3 + len(what)]) + b"\x00\x01" + what + b"\x00")
    assert link.recv(5)[:1] == b"\x90"
    return link


def test_a_client_that_reads_no_more_delays_nobody_and_its_id_can_be_taken_over_at_once(broker, join, version, topic):
    """As a board whose Wi-Fi is gone: its connection stands, and nothing is taken from it."""
    sender, reader = join(broker), join(broker)
    reader.subscribe(f"{topic}/small")
    with frozen(broker.port, "board", topic):
        for _ in range(200):
            sender.publish(topic, bytes(100_000), qos=0)
        assert reader.hears(sender, f"{topic}/small")
        began = time.monotonic()
        again = join(broker, "board")
        assert time.monotonic() - began < 1.5
    again.subscribe(topic)
    assert again.hears(sender, topic)
