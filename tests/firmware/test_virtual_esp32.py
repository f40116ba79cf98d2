"""The virtual ESP32 as a process, against a real mosquitto."""

from __future__ import annotations

import contextlib
import queue
import signal
import socket
import struct
import time
from pathlib import Path

import pytest
from bed_firmware import Bed, wait_for
from bench_firmware import FIRST, LAST, seal, traj

from gemelo.libraries.runtime.process.readiness import ALIVE


def test_the_device_answers_moves_and_leaves_in_order(bed: Bed):
    bed.start_device()
    assert bed.status["referenced"] is True
    wait_for((bed.folder / "run/virtual_esp32.ready").exists, "readiness")
    bed.publish("sync", seal(struct.pack("<BBBBIQ", 0x67, 1, 6, 0, 0, 987654321)))
    t0, t1, t2 = struct.unpack("<QQQ", bed.answer("sync/r")[8:-4])
    assert t0 == 987654321
    assert 0 < t1 <= t2
    with bed.beating():
        assert bed.move(200, 0.5)[20] == 0
        assert bed.event("finished")["stream"] == 1
    assert bed.end_device(signal.SIGTERM) == 0
    wait_for(lambda: bed.status["online"] is False, "the offline status")
    here = [200, 0, 0]
    assert bed.memory() == {"device": "rm1", "steps": here, "moving": False, "referenced": True, "shaft": here}
    assert not (bed.folder / "run/virtual_esp32.ready").exists()
    bed.start_device()
    assert bed.status["referenced"] is True
    assert bed.move(0, 0.5, start=200, stream=2)[20] == 0


def test_without_a_broker_a_device_is_not_ready_and_feeds_the_watchdog(
    bed: Bed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(4.0)  # [s] less than the watchdog's patience
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        bed.start_device()
        wait_for((bed.folder / "run/virtual_esp32.ready").exists, "readiness")
        bed.stop_broker()
        wait_for(lambda: not (bed.folder / "run/virtual_esp32.ready").exists(), "its readiness to be taken back")
        while systemd.recv(100) != b"STATUS=not ready":
            pass
        assert [systemd.recv(100) for _ in range(3)] == [ALIVE.encode()] * 3


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
