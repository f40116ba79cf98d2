"""A real broker and the virtual ESP32, each as its own process on a free port of the loopback."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from gemelo.schemas.deployment import Broker, Deployment, MqttSection, PathsSection, Wire
from tests.optional import need
from tests.stepper_gateway.harness import ROOT

BROKER = "gemelo.services.broker.main"
DEVICE = "gemelo.services.virtual_esp32.main"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Processes:
    """Started by module name, killed with everything they have started themselves."""

    def __init__(
        self, broker: str, folder: Path, wire: Wire = Wire.MQTT, secure_folder: str = "", robot: Path | None = None
    ) -> None:
        self.port = free_port()
        self.deployment = Deployment(
            robot=str(robot or ROOT / "urdf/rm1"),
            wire=wire,
            mqtt=MqttSection(broker=Broker(broker), port=self.port, secure_folder=secure_folder),
            paths=PathsSection(run=str(folder / "run"), out=str(folder / "out")),
        )
        self._log = folder / "processes.log"
        self._environment = os.environ | {
            "GEMELO_ROBOT": self.deployment.robot,
            "GEMELO_WIRE": wire.value,
            "GEMELO_MQTT_BROKER": broker,
            "GEMELO_MQTT_PORT": str(self.port),
            "GEMELO_MQTT_SECURE_FOLDER": secure_folder,
            "GEMELO_PATHS_RUN": self.deployment.paths.run,
            "GEMELO_PATHS_OUT": self.deployment.paths.out,
        }
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, module: str, *arguments: str, environment: Mapping[str, str] | None = None) -> None:
        """What it prints is in `log`."""
        with self._log.open("ab") as log:
            self._running[module] = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                cwd=ROOT,
                env={**self._environment, **(environment or {})},
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    @property
    def log(self) -> str:
        """What the processes have printed."""
        return self._log.read_text()

    @property
    def pids(self) -> list[int]:
        return [process.pid for process in self._running.values()]

    def start_broker(self) -> None:
        """Returns once it listens."""
        if self.deployment.mqtt.broker is Broker.MOSQUITTO:
            need("mosquitto")
        self.start(BROKER)
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.05)
        raise AssertionError("the broker does not listen")

    def signal(self, module: str, number: int) -> None:
        """To the process and what it has started itself."""
        os.killpg(self._running[module].pid, number)

    def kill(self, module: str) -> None:
        process = self._running.pop(module)
        os.killpg(process.pid, signal.SIGKILL)  # its own group, with the broker's child
        process.wait(timeout=60.0)

    def close(self) -> None:
        for module in list(self._running):
            self.kill(module)
