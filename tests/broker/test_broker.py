"""gemelo-broker with both brokers: the same behaviour towards its clients, the person and process-compose."""

from __future__ import annotations

import os
import queue
import signal
import socket
import statistics
import time
from contextlib import suppress

import paho.mqtt.client as mqtt
import psutil
import pytest

from gemelo.schemas.deployment import MqttSection
from gemelo.services.broker import embedded, mosquitto
from gemelo.services.broker.replacement import NotInstalled
from tests.broker.running import BROKERS, Client, RunningBroker, wait_until


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
    subscribed.get(timeout=60.0)
    times = []
    for _ in range(count):
        sent = time.perf_counter()
        client.publish("echo", b"x" * 500, qos=1)
        times.append(arrived.get(timeout=60.0) - sent)
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


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("name", BROKERS)
def test_a_signal_ends_it_at_once_with_zero_and_takes_its_readiness_back(tmp_path, name, number):
    running = RunningBroker(name, tmp_path).wait_ready()
    Client(running.port).connected()
    started = time.monotonic()
    running.popen.send_signal(number)
    assert running.popen.wait(timeout=60.0) == 0, running.output
    assert time.monotonic() - started < 3.0
    wait_until(lambda: not running.ready.exists())


def test_its_log_is_quiet(broker):
    before = broker.output
    echo_times(broker.port, count=3)
    Client(broker.port, will=("test/will", "x", False)).connected().cut()
    with socket.create_connection(("127.0.0.1", broker.port)) as link:
        link.sendall(b"GET / HTTP/1.0\r\n\r\n")
        with suppress(ConnectionResetError):
            assert link.recv(1) == b""
    assert len(broker.output.splitlines()) <= 3, broker.output
    assert broker.output == before


@pytest.mark.parametrize("name", BROKERS)
def test_a_killed_broker_leaves_its_port_to_the_next(tmp_path, name):
    running = RunningBroker(name, tmp_path).wait_ready()
    running.restart(kill=True)
    Client(running.port).connected().close()
    running.stop()


@pytest.mark.parametrize("name", BROKERS)
def test_a_taken_port_is_named_with_its_holder_and_the_setting(tmp_path, name):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        running = RunningBroker(name, tmp_path, port)
        assert running.popen.wait(timeout=60.0) == 1
    assert f"port {port} on 127.0.0.1 is taken" in running.output
    assert f"(pid {os.getpid()})" in running.output
    assert "GEMELO_MQTT_PORT" in running.output
    assert "Traceback" not in running.output


def test_a_missing_program_is_said_with_the_remedy(monkeypatch, tmp_path):
    monkeypatch.setattr("gemelo.services.broker.mosquitto.shutil.which", lambda *_, **__: None)
    with pytest.raises(NotInstalled, match="sudo apt-get install mosquitto, or GEMELO_MQTT_BROKER=embedded") as missing:
        mosquitto.find()
    assert missing.value.reason.code == "broker.none.mosquitto"
    monkeypatch.setattr("gemelo.services.broker.embedded.project_root", lambda: tmp_path)
    with pytest.raises(NotInstalled, match=r"gemelo-mqtt is not there: make setup builds it .*BROKER=mosquitto"):
        embedded.find()


def test_it_stands_aside_for_a_broker_that_runs_already(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as theirs:
        running = RunningBroker("external", tmp_path, theirs.getsockname()[1]).wait_ready()
        output = running.stop()
    assert running.popen.returncode == 0
    assert "this one stands aside" in output
    assert not running.ready.exists()


def test_mosquitto_is_told_to_send_at_once_and_to_keep_nothing():
    conf = mosquitto.configuration(MqttSection(host="10.0.0.2", port=1, listen_host="127.0.0.1", listen_port=1234))
    assert "listener 1234 127.0.0.1" in conf
    assert "allow_anonymous true" in conf
    assert "set_tcp_nodelay true" in conf
    assert "persistence false" in conf


def test_a_broker_that_cannot_start_is_not_said_to_listen(monkeypatch, tmp_path):
    """mosquitto itself ends, here for a file that it cannot use: nobody has listened, so nobody says so."""
    program = tmp_path / "mosquitto"
    program.write_text("#!/bin/sh\necho 'Error: Unable to open log file' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    broker = RunningBroker("mosquitto", tmp_path / "broker")
    assert broker.popen.wait(20.0) == 1
    assert "Unable to open log file" in broker.output
    assert "listens on" not in broker.output


@pytest.mark.parametrize("name", BROKERS)
def test_a_broker_says_where_it_listens_once_it_answers(tmp_path, name):
    broker = RunningBroker(name, tmp_path)
    try:
        wait_until(lambda: f"{name} listens on 127.0.0.1 port {broker.port}" in broker.output)
        assert broker.output.count("listens on") == 1
    finally:
        broker.popen.terminate()
        broker.popen.wait(20.0)
