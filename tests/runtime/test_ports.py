"""The check that a port is free, and the sentence where it is not."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from tests.runtime.support import free_port


def test_a_free_port_may_be_listened_on() -> None:
    require_free("127.0.0.1", free_port(), "router")


def test_a_taken_port_is_named_with_its_holder_and_the_key_to_change() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        with pytest.raises(PortTaken) as taken:
            require_free("127.0.0.1", port, "viewer", "web_port")
    assert f"port {port} on 127.0.0.1 is taken by " in str(taken.value)
    assert f"(pid {os.getpid()}), which runs in {Path.cwd()}: stop that" in str(taken.value)
    assert "GEMELO_VIEWER_WEB_PORT or [viewer] web_port" in str(taken.value)
    assert taken.value.reason.code == "port.taken.here"
    assert taken.value.reason.values.items() >= {"host": "127.0.0.1", "port": port, "process": os.getpid()}.items()


def test_a_port_of_a_twin_that_was_forgotten_in_another_folder_is_named_with_that_folder(tmp_path: Path) -> None:
    listening = (
        "import socket; s = socket.create_server(('127.0.0.1', 0)); print(s.getsockname()[1], flush=True); input()"
    )
    command = [sys.executable, "-c", listening]
    with subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        port = int(other.stdout.readline())
        with pytest.raises(PortTaken, match=re.escape(f"(pid {other.pid}), which runs in {tmp_path} (a twin of that")):
            require_free("127.0.0.1", port, "router")
        other.kill()


@pytest.mark.parametrize(("host", "port"), [("192.0.2.1", 1883), ("127.0.0.1", 70000)])
def test_an_address_that_is_not_ours_or_none_at_all_is_refused_with_the_key(host: str, port: int) -> None:
    with pytest.raises(PortTaken, match=f"cannot listen on {host} port {port}.*GEMELO_MQTT_PORT"):
        require_free(host, port, "mqtt")
