"""A virtual ESP32 as a process, a real mosquitto, and a client that hears all of it."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import select
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from bench_firmware import FIRST, LAST, Row, command, heartbeat, smooth, traj
from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, json_frame, packet, parse_json_frame
from gemelo.schemas.device import DeviceCommandKind, InjectKind
from tests.optional import need

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 60.0  # [s]
NOT_ARMED = 17


def mosquitto_path() -> str:
    need("mosquitto")
    found = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
    assert found
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

    def __init__(self, folder: Path, device: str, robot: str) -> None:
        self.folder, self.port = folder, free_port()
        self._topic, self._robot = f"gemelo/v1/{device}/", robot
        self.states: list[tuple[float, bytes]] = []  # arrival [s, monotonic] and frame
        self.broker: subprocess.Popen[bytes] | None = None
        self.process: subprocess.Popen[bytes] | None = None
        self.heard: dict[str, queue.SimpleQueue[bytes]] = {}
        self.status: dict[str, object] = {}
        self.client = paho.Client(CallbackAPIVersion.VERSION2)
        self.client.on_message = self._hear
        self.client.on_connect = lambda client, *_: client.subscribe(f"{self._topic}#", 1)
        self.client.reconnect_delay_set(min_delay=1, max_delay=1)
        self._beats = self._commands = 0

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

    def start_device(self, *arguments: str) -> None:
        before = self.status.get("boot_id")
        settings = {"MQTT_PORT": str(self.port), "PATHS_RUN": str(self.folder / "run"), "ROBOT": self._robot}
        environ = os.environ | {f"GEMELO_{key}": value for key, value in settings.items()}
        command = [sys.executable, "-m", "gemelo.services.virtual_esp32.main", *arguments]
        with open(self.folder / "device.log", "ab") as log:
            self.process = subprocess.Popen(command, cwd=ROOT, env=environ, stdout=log, stderr=log)
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
        if (self.folder / "device.log").exists():
            print(self.log)  # pytest shows it where a test has failed

    def _hear(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        kind = message.topic.removeprefix(self._topic)
        if kind == "status":
            self.status = json.loads(message.payload)
        elif kind == "state":
            self.states.append((time.monotonic(), message.payload))
        self.heard.setdefault(kind, queue.SimpleQueue()).put(message.payload)

    @property
    def log(self) -> str:
        """What the device's processes have logged."""
        return (self.folder / "device.log").read_text()

    def publish(self, kind: str, frame: bytes, retain: bool = False) -> None:
        self.client.publish(self._topic + kind, frame, qos=0 if kind in ("hb", "sync") else 1, retain=retain)

    def answer(self, kind: str) -> bytes:
        return self.heard.setdefault(kind, queue.SimpleQueue()).get(timeout=PATIENCE)

    def beat(self) -> None:
        self._beats += 1
        self.publish("hb", heartbeat(self._beats))

    @contextlib.contextmanager
    def beating(self) -> Iterator[None]:
        """Ten beats a second, whatever else is done meanwhile."""
        over = threading.Event()

        def beat_on() -> None:
            while not over.wait(0.1):
                self.beat()

        heart = threading.Thread(target=beat_on)
        self.beat()
        heart.start()
        try:
            yield
        finally:
            over.set()
            heart.join()

    def chunk(self, goal: int, duration: float, start: int = 0, stream: int = 1) -> bytes:
        """A whole move of q1 in one TRAJ frame, for this boot."""
        boot = self.status["boot_id"]
        assert isinstance(boot, int)
        rows: list[Row] = []
        for i in range(round(duration * 50) + 1):
            p, v = smooth(start, goal, duration, i * 0.02)
            rows.append(([round(p * 256), 0, 0], [round(v * 256), 0, 0]))
        return traj(stream, 0, rows, FIRST | LAST, boot=boot)

    def move(self, goal: int, duration: float, start: int = 0, stream: int = 1) -> bytes:
        """Send a whole move of q1, once the drivers have been energised for long enough; returns the ACK."""
        frame = self.chunk(goal, duration, start, stream)
        while True:
            self.publish("traj", frame)
            answer = self.answer("traj/ack")
            if answer[20] != NOT_ARMED:
                return answer
            time.sleep(0.02)

    def order(self, cmd: DeviceCommandKind, argument: int = 0) -> int:
        """Give a command; the code of its acknowledgement."""
        self._commands += 1
        boot = self.status["boot_id"]
        assert isinstance(boot, int)
        self.publish("cmd", command(cmd, self._commands, boot=boot, argument=argument))
        return self.answer("cmd/ack")[13]

    def press(self, kind: InjectKind, target: str = "", value: float = 1.0) -> None:
        """Ask for it; `event` says what came of it."""
        self.publish("inject", json.dumps({"kind": kind, "target": target, "value": value}).encode())

    def shaft(self) -> dict[str, list[int]]:
        """What the device says of its shafts next."""
        self.heard.pop("shaft", None)
        report: dict[str, list[int]] = json.loads(self.answer("shaft"))
        return report

    def event(self, name: str) -> dict[str, object]:
        while True:
            event: dict[str, object] = json.loads(self.answer("event"))
            if event["event"] == name:
                return event

    def memory(self) -> dict[str, object]:
        content: dict[str, object] = json.loads((self.folder / "run/virtual_esp32.json").read_text())
        return content


class SerialPort:
    """Our end of a device's serial line."""

    def __init__(self, path: Path) -> None:
        self._line = os.open(path, os.O_RDWR | os.O_NOCTTY)
        self._packets = PacketDecoder()
        self._heard: list[bytes] = []

    def send(self, frame: bytes) -> None:
        os.write(self._line, packet(frame))

    def send_json(self, kind: JsonFrame, message: dict[str, object] | bytes) -> None:
        text = message if isinstance(message, bytes) else json.dumps(message).encode()
        self.send(json_frame(kind, text))

    def answer(self, kind: int) -> bytes:
        """The next frame of that type."""
        deadline = time.monotonic() + PATIENCE
        while True:
            for index, frame in enumerate(self._heard):
                if frame[2] == kind:
                    del self._heard[: index + 1]
                    return frame
            self._heard.clear()
            ready, _, _ = select.select([self._line], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, f"waited {PATIENCE} s for a frame of type {kind}"
            self._heard += [frame for frame in self._packets.feed(os.read(self._line, 4096)) if len(frame) > 8]

    def json(self, kind: JsonFrame) -> dict[str, object]:
        """The next JSON of that type."""
        found = parse_json_frame(self.answer(kind))
        assert found is not None
        message: dict[str, object] = json.loads(found.text)
        return message

    def close(self) -> None:
        os.close(self._line)


@contextlib.contextmanager
def open_bed(folder: Path, device: str = "rm1", robot: str = "urdf/rm1") -> Iterator[Bed]:
    """A broker with a client that listens; the device is still off."""
    bed = Bed(folder, device, robot)
    try:
        bed.start_broker()
        bed.listen()
        yield bed
    finally:
        bed.close()
