"""A run folder whose disk refuses: nothing is raised, who is ready still says so, and the reason is reported once."""

from __future__ import annotations

import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path

import pytest

from gemelo.libraries.runtime import endpoints
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.errors import BusError
from gemelo.libraries.runtime.process.beat_socket import newest_beat
from gemelo.libraries.runtime.process.readiness import Readiness, is_fresh, says_ready
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.deployment import MqttSection, RouterSection
from gemelo.services.broker.replacement import OwnClient
from gemelo.tools.chaos.descriptors import give_descriptors, take_descriptors
from tests.descriptors import few_descriptors
from tests.disks import WAYS, Disk, refusing_disk
from tests.optional import need
from tests.runtime.support import free_port, until


@pytest.fixture(params=WAYS)
def disk(request, tmp_path) -> Iterator[Disk]:
    with refusing_disk(request.param, tmp_path / "run") as disk:
        yield disk


def probe(folder, *words: str) -> subprocess.CompletedProcess[str]:
    environ = {"PATH": os.environ["PATH"], "GEMELO_PATHS_RUN": str(folder)}
    return subprocess.run(
        ["deploy/probe", "gateway", *words], cwd=project_root(), env=environ, capture_output=True, text=True
    )


def grow_old(folder) -> None:
    """The files that the process has written before count no more."""
    for file in folder.glob("*.*") if folder.is_dir() else ():
        os.utime(file, (time.time() - 9.0,) * 2)


def test_a_process_that_starts_on_a_disk_that_refuses_is_ready_and_says_once_what_is_wrong(disk):
    disk.refuse()
    reports: list[str] = []
    unwritten = UnwrittenFiles(reports.append)
    readiness = Readiness(disk.folder, "gateway", unwritten)
    readiness.not_ready("no board yet")
    assert not says_ready(disk.folder, "gateway")
    assert probe(disk.folder).returncode == 1
    readiness.ready()
    for _ in range(3):
        readiness.beat()
        assert says_ready(disk.folder, "gateway")
        assert probe(disk.folder).returncode == 0
    (report,) = reports
    assert "the readiness of gateway" in report
    assert "the readiness of gateway" in unwritten.sentence
    disk.take()
    readiness.beat()
    assert (disk.folder / "gateway.ready").read_text() == f"{os.getpid()}\n"
    assert (disk.folder / "gateway.alive").read_text().startswith(f"{os.getpid()} ")
    assert (len(reports), unwritten.sentence) == (2, "")
    assert newest_beat(disk.folder, "gateway", 3600.0) == ""
    assert probe(disk.folder).returncode == 0


def test_who_loses_its_disk_stays_ready_and_is_not_taken_for_one_that_stands_still(disk):
    unwritten = UnwrittenFiles(print)
    readiness = Readiness(disk.folder, "gateway", unwritten)
    readiness.ready()
    readiness.beat()
    grow_old(disk.folder)
    disk.refuse()
    readiness.beat()
    assert says_ready(disk.folder, "gateway")
    assert probe(disk.folder, "restart").returncode == 0
    readiness.not_ready("the board is off")
    readiness.beat()
    disk.take()
    grow_old(disk.folder)
    assert not says_ready(disk.folder, "gateway")
    assert probe(disk.folder, "restart").returncode == 1
    readiness.beat()
    assert (disk.folder / "gateway.problem").read_text() == "the board is off\n"
    assert not (disk.folder / "gateway.ready").exists()


def test_a_beat_by_the_socket_alone_is_over_after_three_seconds(tmp_path):
    (tmp_path / "run").write_text("no folder")
    readiness = Readiness(tmp_path / "run", "gateway", UnwrittenFiles(print))
    readiness.ready()
    assert newest_beat(tmp_path / "run", "gateway", 3.0) == "ready"
    assert newest_beat(tmp_path / "run", "gateway", -1.0) == ""
    assert newest_beat(tmp_path / "run", "planner", 3.0) == ""
    assert newest_beat(tmp_path / "other", "gateway", 3.0) == ""


def test_without_a_disk_and_a_descriptor_a_beat_still_finds_a_socket(tmp_path):
    (tmp_path / "run").write_text("no folder")
    readiness = Readiness(tmp_path / "run", "gateway", UnwrittenFiles(print))
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    free = os.dup(1)
    os.close(free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free, limits[1]))
    try:
        readiness.ready()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    assert says_ready(tmp_path / "run", "gateway")


def test_a_version_that_cannot_be_read_now_is_read_later():
    endpoints.read_version.cache_clear()
    with few_descriptors():
        assert endpoints.own_version() == ""
    assert endpoints.own_version() == version("gemelo")


def test_systemd_hears_of_a_beat_without_a_free_descriptor(tmp_path, monkeypatch):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(5.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        readiness = Readiness(tmp_path, "gateway", UnwrittenFiles(print))
        readiness.beat()
        assert systemd.recv(100).startswith(b"WATCHDOG=1")
        limits = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))
        try:
            readiness.beat()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, limits)
        assert systemd.recv(100).startswith(b"WATCHDOG=1")


@contextmanager
def started(process: str, folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str, int]]:
    """Router or broker, with `folder` as its run folder; its name and port."""
    name, _, broker = process.partition(" ")
    if broker == "mosquitto":
        need("mosquitto")
    port = free_port()
    environ = os.environ | {
        f"GEMELO_{'ROUTER' if name == 'router' else 'MQTT'}_PORT": str(port),
        "GEMELO_MQTT_BROKER": broker or "embedded",
        "GEMELO_PATHS_RUN": str(folder),
    }
    module = "gemelo.services.router.main" if name == "router" else "gemelo.services.broker.main"
    running = subprocess.Popen([sys.executable, "-m", module], cwd=project_root(), env=environ)
    try:
        yield running, name, port
    finally:
        running.kill()
        running.wait()


@pytest.mark.parametrize("process", ["router", "broker embedded"])
def test_router_and_broker_without_a_descriptor_beat_on_and_take_clients_again_afterwards(tmp_path, process):
    with started(process, tmp_path) as (running, name, port):
        assert until(lambda: says_ready(tmp_path, name), 30.0)
        take_descriptors(running.pid)
        for _ in range(3):
            grow_old(tmp_path)
            assert until(lambda: is_fresh(tmp_path / f"{name}.ready"), 60.0)
        give_descriptors(running.pid)
        assert until(lambda: accepts(name, port), 60.0)
        assert running.poll() is None


def accepts(name: str, port: int) -> bool:
    """A router takes a session; a broker answers a client."""
    if name == "router":
        with suppress(BusError):
            ZenohBus(RouterSection(port=port), "rm1").close()
            return True
        return False
    client = OwnClient(MqttSection(port=port))
    try:
        return client.is_answered()
    finally:
        client.leave()


@pytest.mark.parametrize("process", ["router", "broker embedded", "broker mosquitto"])
def test_router_and_broker_start_while_the_disk_refuses_and_live_on_when_it_begins_to(disk, process):
    disk.refuse()
    with started(process, disk.folder) as (running, name, port):
        assert until(lambda: says_ready(disk.folder, name), 30.0)
        socket.create_connection(("127.0.0.1", port), 5.0).close()
        disk.take()
        assert until(lambda: (disk.folder / f"{name}.ready").exists(), 60.0)
        disk.refuse()
        if disk.folder.is_dir() and os.access(disk.folder, os.W_OK):  # a full disk lets a file be touched that is there
            grow_old(disk.folder)
            assert until(lambda: is_fresh(disk.folder / f"{name}.ready"), 60.0)
        else:
            assert until(lambda: newest_beat(disk.folder, name, 3.0) == "ready", 60.0)
        assert running.poll() is None
        running.terminate()
        assert running.wait(10.0) == 0
