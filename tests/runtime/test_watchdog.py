"""systemd hears when a process is ready and, by the same beat, that its loop runs; a frozen one falls silent."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from gemelo.libraries.runtime.process.readiness import Readiness, notify
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from tests.runtime.support import ROOT, free_port

BEAT = 1.0  # [s]
ALIVE = b"WATCHDOG=1\nEXTEND_TIMEOUT_USEC=5000000"


@pytest.fixture
def systemd(tmp_path, monkeypatch) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(10.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield listening


def test_a_router_is_ready_beats_and_falls_silent_when_it_is_frozen(systemd, tmp_path):
    environ = os.environ | {"GEMELO_ROUTER_PORT": str(free_port()), "GEMELO_PATHS_RUN": str(tmp_path / "run")}
    process = subprocess.Popen([sys.executable, "-m", "gemelo.services.router.main"], cwd=ROOT, env=environ)
    try:
        assert systemd.recv(100) == b"READY=1\nSTATUS=ready"
        assert systemd.recv(100) == ALIVE
        require_silence_of_a_frozen(process, systemd)
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("module", ["gemelo.services.state_publisher.main", "gemelo.services.panel.main"])
def test_a_process_that_waits_for_the_router_goes_on_with_its_start_and_falls_silent_when_it_is_frozen(
    systemd, tmp_path, module
):
    """What it waits for may never come: only by its word does systemd know that from a start that hangs."""
    environ = os.environ | {
        "GEMELO_ROUTER_PORT": str(free_port()), "GEMELO_PATHS_RUN": str(tmp_path / "run"),
        "GEMELO_PANEL_PORT": str(free_port()),
    }  # fmt: skip
    process = subprocess.Popen([sys.executable, "-m", module], cwd=ROOT, env=environ)
    try:
        systemd.settimeout(90.0)  # as long as a start may take without a word
        assert [systemd.recv(100) for _ in range(3)] == [ALIVE] * 3
        require_silence_of_a_frozen(process, systemd)
    finally:
        process.kill()
        process.wait()


def require_silence_of_a_frozen(process: subprocess.Popen[bytes], systemd: socket.socket) -> None:
    process.send_signal(signal.SIGSTOP)
    systemd.settimeout(2.5 * BEAT)
    with pytest.raises(TimeoutError):
        list(iter(partial(systemd.recv, 100), b""))


def test_a_process_that_is_not_ready_any_more_still_feeds_the_watchdog(systemd, tmp_path):
    readiness = Readiness(tmp_path, "gateway", UnwrittenFiles(print))
    readiness.beat()
    readiness.ready()
    readiness.not_ready()
    readiness.beat()
    said = [systemd.recv(100) for _ in range(4)]
    assert said == [ALIVE, b"READY=1\nSTATUS=ready", b"STATUS=not ready", ALIVE]


def test_without_systemd_or_when_it_is_gone_nothing_is_said_and_nothing_fails(tmp_path, monkeypatch):
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", str(Path(tmp_path, "gone")))
    notify("READY=1")
    monkeypatch.setenv("NOTIFY_SOCKET", "@gemelo-no-such")
    notify("READY=1")
