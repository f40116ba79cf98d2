"""gemelo-broker with both brokers: the same behaviour towards its clients, the person and process-compose."""

from __future__ import annotations

import os
import queue
import signal
import socket
import statistics
import subprocess
import sys
import time

import paho.mqtt.client as mqtt
import psutil
import pytest

from schemas.deployment import MqttSection
from services.broker import mosquitto
from services.runtime.deployment import project_root
from services.stack.stack import free_ports
from tests.optional import need

BROKERS = ["amqtt", "mosquitto"]


class Process:
    """A gemelo-broker of its own port and folder."""

    def __init__(self, broker, folder, port=None):
        if broker == "mosquitto":
            need("mosquitto")
        self.port = port or free_ports(1)[0]
        self.ready = folder / "broker.ready"
        settings = {"GEMELO_MQTT_BROKER": broker, "GEMELO_MQTT_PORT": str(self.port), "GEMELO_PATHS_RUN": str(folder)}
        self.popen = subprocess.Popen(
            [sys.executable, "-m", "services.broker.main"],
            cwd=project_root(),
            env={**os.environ, **settings},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def wait_ready(self):
        wait_until(lambda: self.ready.exists() or self.popen.poll() is not None, 10.0)
        assert self.ready.exists(), self.popen.communicate()[0]

    def stop(self):
        if self.popen.poll() is None:
            self.popen.terminate()
        return self.popen.communicate(timeout=10)[0]


def wait_until(condition, timeout):
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)


@pytest.fixture(params=BROKERS)
def broker(request, tmp_path):
    process = Process(request.param, tmp_path)
    process.wait_ready()
    yield process
    process.stop()


def echo_times(port, count=50):
    """Round trips [s] of QoS 1 messages to oneself."""
    arrived, subscribed = queue.Queue(), queue.Queue()
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.on_message = lambda *_: arrived.put(time.perf_counter())
    client.on_subscribe = lambda *_: subscribed.put(True)
    client.on_socket_open = lambda _client, _data, sock: sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    client.connect("127.0.0.1", port)
    client.loop_start()
    client.subscribe("echo", qos=1)
    subscribed.get(timeout=5)
    times = []
    for _ in range(count):
        sent = time.perf_counter()
        client.publish("echo", b"x" * 500, qos=1)
        times.append(arrived.get(timeout=5) - sent)
    client.disconnect()
    client.loop_stop()
    return times


def test_a_message_comes_back_without_the_delay_of_nagle(broker):
    assert statistics.median(echo_times(broker.port)) < 0.02


def test_it_listens_on_loopback_only(broker):
    listening = [each for each in psutil.net_connections("tcp") if each.laddr and each.laddr.port == broker.port]
    hosts = {each.laddr.ip for each in listening if each.status == psutil.CONN_LISTEN}
    assert hosts == {"127.0.0.1"}


def test_it_says_that_it_is_ready_again_and_again(broker):
    first = broker.ready.stat().st_mtime
    wait_until(lambda: broker.ready.stat().st_mtime > first, 3.0)
    assert broker.ready.stat().st_mtime > first


def test_a_sigterm_ends_it_at_once_with_zero_and_takes_its_readiness_back(broker):
    started = time.monotonic()
    output = broker.stop()
    assert broker.popen.returncode == 0, output
    assert time.monotonic() - started < 6.0
    wait_until(lambda: not broker.ready.exists(), 2.0)
    assert not broker.ready.exists()


def test_its_log_is_quiet(broker):
    echo_times(broker.port, count=3)
    output = broker.stop()
    assert len(output.splitlines()) <= 3, output


@pytest.mark.parametrize("name", BROKERS)
def test_a_killed_broker_leaves_its_port_to_the_next(tmp_path, name):
    first = Process(name, tmp_path)
    first.wait_ready()
    first.popen.kill()
    first.popen.communicate(timeout=5)  # returns when nothing holds its output any more
    first.ready.unlink(missing_ok=True)
    second = Process(name, tmp_path, first.port)
    second.wait_ready()
    second.stop()
    assert second.popen.returncode == 0


@pytest.mark.parametrize("name", BROKERS)
def test_a_taken_port_is_named_with_its_holder_and_the_setting(tmp_path, name):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        process = Process(name, tmp_path, port)
        output = process.popen.communicate(timeout=10)[0]
    assert process.popen.returncode == 1
    assert f"port {port} on 127.0.0.1 is taken" in output
    assert f"(pid {os.getpid()})" in output
    assert "GEMELO_MQTT_PORT" in output
    assert "Traceback" not in output


def test_a_missing_mosquitto_is_said_with_the_remedy(monkeypatch):
    monkeypatch.setattr("services.broker.mosquitto.shutil.which", lambda *_, **__: None)
    with pytest.raises(mosquitto.NotInstalled, match="sudo apt-get install mosquitto, or GEMELO_MQTT_BROKER=amqtt"):
        mosquitto.find()


def test_it_stands_aside_for_a_broker_that_runs_already(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as theirs:
        process = Process("external", tmp_path, theirs.getsockname()[1])
        process.wait_ready()
        output = process.stop()
    assert process.popen.returncode == 0
    assert "this one stands aside" in output
    assert not process.ready.exists()


def test_mosquitto_is_told_to_send_at_once_and_to_keep_nothing():
    conf = mosquitto.configuration(MqttSection(host="10.0.0.2", port=1, listen_host="127.0.0.1", listen_port=1234))
    assert "listener 1234 127.0.0.1" in conf
    assert "allow_anonymous true" in conf
    assert "set_tcp_nodelay true" in conf
    assert "persistence false" in conf


def test_an_interrupt_ends_it_too(tmp_path):
    process = Process("amqtt", tmp_path)
    process.wait_ready()
    process.popen.send_signal(signal.SIGINT)
    process.popen.communicate(timeout=5)
    assert process.popen.returncode == 0
