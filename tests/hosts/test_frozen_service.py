"""A service that stands still on a host without systemd is started anew by what process-compose looks at anyway."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.keys import make_keys
from gemelo.tools.hosts.render import write
from tests.runtime.support import free_port, until

SITE = """
[router]
host = "one"
port = {port}
[broker]
host = "one"
[robots.rm1]
folder = "urdf/rm1"
[hosts.one]
address = "127.0.0.1"
[hosts.one.services]
rm1 = ["stepper_gateway", "virtual_esp32", "state_publisher"]
"""
START = 60.0  # [s]
ANEW = 60.0  # [s]; 5 of standing still, 2 of certainty and 1 of process-compose's own where nothing else runs


@pytest.fixture
def run_folder(tmp_path) -> Iterator[Path]:
    """Where the router of a host says how it is, run by process-compose from the host's rendered file."""
    file = tmp_path / "lab.toml"
    file.write_text(SITE.format(port=free_port()))
    folder = tmp_path / "out"
    lab = msgspec.structs.replace(
        load_site(file, project_root()), project=str(project_root()), config=str(folder / "one"),
        state=str(tmp_path / "state"),
    )  # fmt: skip
    make_keys(lab, folder, project_root())
    write(lab, "one", folder / "one")
    process = subprocess.Popen(
        [project_root() / ".venv/bin/process-compose", "up", "gemelo-router", "-t=false", "-f", "process-compose.yaml"],
        cwd=folder / "one", stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
        env=os.environ | {"PC_SOCKET_PATH": str(tmp_path / "pc.sock"), "PC_USE_UDS": "1",
                          "PC_LOG_FILE": str(tmp_path / "pc.log")},
    )  # fmt: skip
    yield tmp_path / "state/host/run"
    process.terminate()
    process.wait(30.0)


def test_a_frozen_router_is_started_anew_without_a_hand(run_folder):
    ready, alive = run_folder / "router.ready", run_folder / "router.alive"
    assert until(lambda: ready.exists() and alive.exists() and alive.read_text(), START)
    before = alive.read_text()
    os.kill(int(before.split()[0]), signal.SIGSTOP)
    assert until(lambda: alive.exists() and alive.read_text() not in ("", before) and ready.exists(), ANEW)
