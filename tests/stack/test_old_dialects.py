"""An old publisher on a running stack: its `ra/juntas` moves the arm, and the wire is measured beside it."""

from __future__ import annotations

import json
import queue
import signal
import subprocess
import time

import pytest
from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.schemas.device import DeviceMode
from gemelo.tools.stack.stack import Stack
from tests.stack.gemelo import COMMAND, gemelo

PROCESSES = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner")
LONGEST = 60.0  # [s]


@pytest.fixture
def stack(tmp_path):
    with Stack(broker="mosquitto", out=tmp_path, processes=PROCESSES) as running:
        yield running


def joints(stack) -> list[dict[str, float]]:
    return json.loads(gemelo(stack, "state", "--json"))["joints"]


def until(is_so) -> None:
    end = time.monotonic() + LONGEST
    while not is_so():
        assert time.monotonic() < end


def test_an_old_publisher_moves_our_arm_and_the_wire_is_measured(stack):
    said: queue.Queue[tuple[str, bytes]] = queue.Queue()
    publisher = paho.Client(CallbackAPIVersion.VERSION2)
    publisher.on_message = lambda _client, _data, message: said.put((message.topic, message.payload))
    publisher.connect("127.0.0.1", int(stack.environment["GEMELO_MQTT_PORT"]))
    publisher.subscribe("ra/#")
    publisher.loop_start()
    with listening(stack) as listener:
        try:
            drive_and_measure(stack, publisher, listener, said)
        finally:
            listener.kill()  # else what fails would wait for it for ever
    publisher.disconnect()
    publisher.loop_stop()


def listening(stack) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*COMMAND, "link", "ra"], cwd=stack.root, env=stack.environment, text=True, bufsize=1,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip


def drive_and_measure(stack, publisher, listener, said) -> None:
    assert "ra/juntas moves rm1 now" in listener.stdout.readline()
    heard: dict[str, bytes] = {}
    until(lambda: heard.update([said.get(timeout=LONGEST)]) or heard.keys() >= {"ra/estados", "ra/sensores"})
    for payload in heard.values():  # as the seed's script reads it, and as another one
        assert json.loads(payload)["Estado"] == int(DeviceMode.IDLE)
    assert json.loads(heard["ra/estados"])["estado"] == int(DeviceMode.IDLE)
    assert json.loads(kept(stack, "ra/estados")) == json.loads(heard["ra/estados"]), "as the sketch has it kept"

    for _ in range(50):  # as fast as the broker takes them: the sketch would keep the last one only
        publisher.publish("ra/juntas", '{"q1": 0.9, "q2": -0.9, "q3": 0, "avanzar": 0}', qos=1)
    until(lambda: [joint["executed_steps"] for joint in joints(stack)] == [2333, -50, 0])
    publisher.publish("ra/juntas", '{"q1": 1, "q2": 1, "avanzar": 1}', qos=1)
    assert "q3 missing" in listener.stdout.readline()
    until(lambda: "avanzar on" in gemelo(stack, "device", "status"))
    publisher.publish("ra/juntas", '{"q1": 200, "q2": 0, "q3": 0}', qos=1)
    assert 'joint "brazo_joint" (q1) would be at' in listener.stdout.readline()

    bench = json.loads(gemelo(stack, "link", "bench", "--rate", "50", "--count", "25", "--json"))
    assert (bench["count"], bench["lost"]) == (25, 0)
    assert 0.0 < bench["median"] < 250.0
    assert [joint["executed_steps"] for joint in joints(stack)] == [2333, -50, 0]

    listener.send_signal(signal.SIGINT)
    assert listener.wait(LONGEST) == 0
    assert kept(stack, "ra/estados") == b"", "nobody is here any more"


def kept(stack, topic: str) -> bytes:
    """What the broker has kept of `topic`; empty if nothing: the answer to our own message comes behind it."""
    found: queue.Queue[bytes] = queue.Queue()
    reader = paho.Client(CallbackAPIVersion.VERSION2)
    reader.on_message = lambda _client, _data, message: found.put(message.payload if message.retain else b"")
    reader.connect("127.0.0.1", int(stack.environment["GEMELO_MQTT_PORT"]))
    reader.subscribe([(topic, 0), ("kept/end", 0)])
    reader.publish("kept/end", "")
    reader.loop_start()
    try:
        return found.get(timeout=LONGEST)
    finally:
        reader.disconnect()
        reader.loop_stop()
