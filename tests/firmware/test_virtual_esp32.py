"""The virtual ESP32 as a process, against a real mosquitto."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bench_firmware import FIRST, LAST, Row, heartbeat, seal, smooth, traj
from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 10.0  # [s]


def mosquitto_path() -> str:
    found = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    assert found, "these tests need mosquitto: sudo apt-get install mosquitto"
    return found


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, f"waited {patience} s for {what}"
        time.sleep(0.01)


class Bed:
    """A broker, a client that listens to everything of the device, and the device's process."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.broker: subprocess.Popen[bytes] | None = None
        self.process: subprocess.Popen[bytes] | None = None
        self.heard: dict[str, queue.SimpleQueue[bytes]] = {}
        self.status: dict[str, object] = {}
        self.client = paho.Client(CallbackAPIVersion.VERSION2)
        self.client.on_message = self._hear
        self.client.on_connect = lambda client, *_: client.subscribe("gemelo/v1/rm1/#", 1)
        self.client.reconnect_delay_set(min_delay=1, max_delay=1)
        self._beats = 0

    def start_broker(self) -> None:
        config = self.folder / "mosquitto.conf"
        config.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n")
        self.broker = subprocess.Popen([mosquitto_path(), "-c", config], stderr=subprocess.DEVNULL)
        wait_for(self._answers, "mosquitto")

    def _answers(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def stop_broker(self) -> None:
        assert self.broker is not None
        self.broker.kill()
        self.broker.wait()

    def listen(self) -> None:
        self.client.connect("127.0.0.1", self.port)
        self.client.loop_start()
        wait_for(self.client.is_connected, "our own connection")

    def start_device(self) -> None:
        before = self.status.get("boot_id")
        environ = os.environ | {"GEMELO_MQTT_PORT": str(self.port), "GEMELO_PATHS_RUN": str(self.folder / "run")}
        self.process = subprocess.Popen([sys.executable, "-m", "firmware.platform.host.main"], cwd=ROOT, env=environ)
        wait_for(lambda: self.status.get("online") is True and self.status["boot_id"] != before, "the device's status")

    def end_device(self, number: int) -> int:
        assert self.process is not None
        self.process.send_signal(number)
        return self.process.wait(PATIENCE)

    def close(self) -> None:
        for process in (self.process, self.broker):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
        self.client.disconnect()
        self.client.loop_stop()

    def _hear(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        kind = message.topic.removeprefix("gemelo/v1/rm1/")
        if kind == "status":
            self.status = json.loads(message.payload)
        self.heard.setdefault(kind, queue.SimpleQueue()).put(message.payload)

    def publish(self, kind: str, frame: bytes, retain: bool = False) -> None:
        self.client.publish(f"gemelo/v1/rm1/{kind}", frame, qos=1 if kind in ("traj", "cmd") else 0, retain=retain)

    def answer(self, kind: str) -> bytes:
        return self.heard.setdefault(kind, queue.SimpleQueue()).get(timeout=PATIENCE)

    def beat(self) -> None:
        self._beats += 1
        self.publish("hb", heartbeat(self._beats))

    def move(self, goal: int, duration: float, start: int = 0, stream: int = 1) -> bytes:
        """Send a whole move of q1; returns the ACK."""
        boot = self.status["boot_id"]
        assert isinstance(boot, int)
        rows: list[Row] = []
        for i in range(round(duration * 50) + 1):
            p, v = smooth(start, goal, duration, i * 0.02)
            rows.append(([round(p * 256), 0, 0], [round(v * 256), 0, 0]))
        self.publish("traj", traj(stream, 0, rows, FIRST | LAST, boot=boot))
        return self.answer("traj/ack")

    def event(self, name: str) -> dict[str, object]:
        while True:
            event: dict[str, object] = json.loads(self.answer("event"))
            if event["event"] == name:
                return event

    def memory(self) -> dict[str, object]:
        content: dict[str, object] = json.loads((self.folder / "run/virtual_esp32.json").read_text())
        return content


@pytest.fixture
def bed(tmp_path: Path) -> Iterator[Bed]:
    bed = Bed(tmp_path)
    try:
        bed.start_broker()
        bed.listen()
        yield bed
    finally:
        bed.close()


def test_the_device_answers_moves_and_leaves_in_order(bed: Bed):
    bed.start_device()
    assert bed.status["referenced"] is True
    wait_for((bed.folder / "run/virtual_esp32.ready").exists, "readiness")
    bed.publish("sync", seal(struct.pack("<BBBBIQ", 0x67, 1, 6, 0, 0, 987654321)))
    t0, t1, t2 = struct.unpack("<QQQ", bed.answer("sync/r")[8:-4])
    assert t0 == 987654321
    assert 0 < t1 <= t2
    bed.beat()
    assert bed.move(200, 0.5)[20] == 0
    assert bed.event("finished")["stream"] == 1
    assert bed.end_device(signal.SIGTERM) == 0
    wait_for(lambda: bed.status["online"] is False, "the offline status")
    assert bed.memory() == {"device": "rm1", "steps": [200, 0, 0], "moving": False, "referenced": True}
    assert not (bed.folder / "run/virtual_esp32.ready").exists()
    bed.start_device()
    assert bed.status["referenced"] is True
    assert bed.move(0, 0.5, start=200, stream=2)[20] == 0


def test_a_device_that_is_killed_while_moving_wakes_up_unreferenced(bed: Bed):
    bed.start_device()
    bed.beat()
    assert bed.move(2000, 2.0)[20] == 0
    bed.event("started")
    assert bed.end_device(signal.SIGKILL) == -signal.SIGKILL
    wait_for(lambda: bed.status["online"] is False, "the last will")
    assert bed.memory()["moving"] is True
    bed.start_device()
    assert bed.status["referenced"] is False
    assert bed.status["reset_cause"] == "lost_while_moving"
    refusal = bed.move(2000, 2.0)
    assert (refusal[20], struct.unpack("<i", refusal[24:28])[0]) == (12, 1)  # NOT_READY, Unreferenced


def test_a_device_that_is_asked_to_end_while_moving_stops_on_its_path_first(bed: Bed):
    bed.start_device()
    bed.beat()
    assert bed.move(2000, 2.0)[20] == 0
    bed.event("started")
    time.sleep(0.5)
    assert bed.end_device(signal.SIGTERM) == 0
    memory = bed.memory()
    assert memory["moving"] is False
    assert memory["referenced"] is True
    steps = memory["steps"]
    assert isinstance(steps, list)
    assert 0 < steps[0] < 2000


def test_a_device_that_loses_its_broker_holds_by_itself_and_comes_back(bed: Bed):
    bed.start_device()
    bed.beat()
    assert bed.move(4000, 2.5)[20] == 0
    bed.stop_broker()
    time.sleep(2.5)
    assert bed.memory()["moving"] is False  # it stands, though nobody could tell it to
    bed.start_broker()
    wait_for(lambda: not bed.heard["state"].empty() or bed.client.is_connected(), "our own connection")
    while True:
        state = bed.answer("state")
        if struct.unpack("<Q", state[8:16])[0] > 3_000_000:
            break
    assert state[16] == 5  # Hold
    assert 0 < struct.unpack("<i", state[60:64])[0] < 4000


def test_retained_wrong_and_oversized_messages_move_nothing(bed: Bed):
    bed.start_device()
    boot = bed.status["boot_id"]
    assert isinstance(boot, int)
    frame = traj(1, 0, [((0, 0, 0), (0, 0, 0))], FIRST | LAST, boot=boot)
    bed.publish("hb", frame)  # a chunk where a heartbeat belongs
    bed.publish("traj", b"\x67\x01" + bytes(1_000_000))
    bed.publish("cmd", b"")
    assert bed.end_device(signal.SIGTERM) == 0
    bed.publish("traj", frame, retain=True)
    bed.start_device()
    # A broker hands retained messages over as such; the boot is another one too.
    assert bed.answer("traj/ack")[20] == 10
    with contextlib.suppress(queue.Empty):
        while True:
            state = bed.heard["state"].get(timeout=0.2)
            assert state[16] == 3  # Idle
            if struct.unpack("<Q", state[8:16])[0] > 500_000:
                break
    bed.publish("traj", b"", retain=True)
