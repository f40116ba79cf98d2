"""A deployment with a real board: the virtual one is ready, says nothing to anybody, and ends when it is asked to."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time


def test_beside_a_board_the_virtual_device_stands_aside(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as broker:
        broker.setblocking(False)
        port = str(broker.getsockname()[1])
        environment = os.environ | {
            "GEMELO_DEVICE": "board", "GEMELO_MQTT_PORT": port, "GEMELO_PATHS_RUN": str(tmp_path),
        }  # fmt: skip
        command = [sys.executable, "-m", "gemelo.services.virtual_esp32.main"]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
            deadline = time.monotonic() + 20.0
            while not (tmp_path / "virtual_esp32.ready").exists():
                assert time.monotonic() < deadline, "never ready"
                time.sleep(0.05)
            process.send_signal(signal.SIGTERM)
            assert process.wait(60.0) == 0
        try:
            caller = broker.accept()[0]
        except BlockingIOError:
            caller = None
    assert caller is None
    assert not (tmp_path / "virtual_esp32.ready").exists()
