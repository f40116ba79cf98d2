"""The stack on a mosquitto with TLS, users and an ACL; its secrets stay in their files."""

from __future__ import annotations

import signal
from pathlib import Path

import psutil
from mcap.reader import make_reader

from gemelo.libraries.mqtt import secure_folder
from gemelo.tools.stack.stack import Stack
from tests.optional import need
from tests.stack.gemelo import gemelo

PROCESSES = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner", "logger")


def recorded(out: Path) -> bytes:
    """All that was written: logs and tables as they are, recordings decompressed."""
    found = []
    for path in filter(Path.is_file, out.rglob("*")):
        found.append(path.read_bytes())
        if path.suffix == ".mcap":
            with path.open("rb") as file:
                found += [message.data for _, _, message in make_reader(file).iter_messages()]
    return b"\n".join(found)


def test_an_arm_moves_behind_the_lock_and_no_secret_is_logged_recorded_or_shown(tmp_path):
    need("mosquitto")
    with Stack(broker="mosquitto", locked_for="rm1", out=tmp_path, processes=PROCESSES) as stack:
        secrets = [secure_folder.password_of(stack.lock, user) for user in ("gateway", "rm1")]
        secrets += [(stack.lock / name).read_text().splitlines()[1] for name in ("ca.key", "server.key")]
        said = gemelo(stack, "move", "--named", "ready") + gemelo(stack, "device", "status")
        running = [psutil.Process(pid) for pid in stack.pids().values()]
        said += "\n".join(" ".join(each.cmdline()) for one in running for each in [one, *one.children(recursive=True)])
        said += "\n".join(gemelo(stack, "param", "list", node) for node in ("stepper_gateway", "logger"))
        stack.kill("logger", signal.SIGTERM)
        said += stack.console()
    written = recorded(tmp_path)
    assert b"joint_states" in written
    assert "mosquitto" in said
    for secret in secrets:
        assert secret not in said
        assert secret.encode() not in written
