"""A broker that stands still is not called ready, and systemd's watchdog is not fed for it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.runtime.process.readiness import ALIVE
from tests.broker.running import BROKERS
from tests.optional import need
from tests.runtime.support import ROOT, free_port, until

LATE = 4.5  # [s] more than what the companion waits for an answer, and less than the watchdog


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(10.0)
        yield listening


@pytest.fixture(params=[(name, lock) for name in BROKERS for lock in ("open", "locked")], ids="-".join)
def broker(request: pytest.FixtureRequest, systemd: socket.socket, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    name, lock = request.param
    if name == "mosquitto":
        need("mosquitto")
    settings = {"MQTT_BROKER": name, "MQTT_PORT": str(free_port()), "PATHS_RUN": str(tmp_path / "run")}
    if lock == "locked":
        secure_folder.make(tmp_path / "secure", ["127.0.0.1"], ["rm1"])
        settings["MQTT_SECURE_FOLDER"] = str(tmp_path / "secure")
    process = subprocess.Popen(
        [sys.executable, "-m", "gemelo.services.broker.main"], cwd=ROOT, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, env=os.environ | {"NOTIFY_SOCKET": str(tmp_path / "notify")}
        | {f"GEMELO_{key}": value for key, value in settings.items()},
    )  # fmt: skip
    yield process
    process.kill()
    process.communicate()


def heard(systemd: socket.socket, seconds: float) -> list[bytes]:
    """What it is told until then."""
    end, said = time.monotonic() + seconds, []
    while (left := end - time.monotonic()) > 0.0:
        systemd.settimeout(left)
        try:
            said.append(systemd.recv(100))
        except TimeoutError:
            break
    return said


def test_one_that_stands_still_is_silent_and_one_that_goes_on_beats_again(
    broker: subprocess.Popen[str], systemd: socket.socket, tmp_path: Path
) -> None:
    ready = tmp_path / "run/broker.ready"
    while systemd.recv(100) != ALIVE.encode():  # mosquitto itself says READY=1 too
        pass
    broker.send_signal(signal.SIGSTOP)
    heard(systemd, 1.0)  # what was under way
    before = ready.stat().st_mtime
    assert heard(systemd, LATE) == []
    assert ready.stat().st_mtime == before
    broker.send_signal(signal.SIGCONT)
    assert until(lambda: ready.stat().st_mtime > before, 60.0)
    assert ALIVE.encode() in heard(systemd, 1.5)


def test_being_asked_every_second_is_not_logged(broker: subprocess.Popen[str], systemd: socket.socket) -> None:
    assert heard(systemd, 4.5).count(ALIVE.encode()) >= 3
    broker.terminate()
    output = broker.communicate(timeout=60.0)[0]
    warned = "should not be run as root" in output
    assert len(output.splitlines()) == 1 + warned, output
