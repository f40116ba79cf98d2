"""`deploy/behind` runs a command in the time that all else leaves, and hides nothing of it."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.runtime.support import until

BEHIND = Path(__file__).parents[2] / "deploy/behind"


@pytest.mark.parametrize("code", [0, 3])
def test_its_output_and_its_exit_code_are_those_of_the_command(code: int) -> None:
    command = [BEHIND, "sh", "-c", f"echo said; echo also >&2; nice; exit {code}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)
    assert done.returncode == code
    assert done.stdout.splitlines() == ["said", "also", "19"]


def test_it_is_ended_with_all_that_it_began(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    command = [BEHIND, "sh", "-c", f"sleep 60 & echo $! >{note}; wait"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as running:
        assert until(lambda: note.exists() and note.read_text().strip())
        running.send_signal(signal.SIGTERM)
        assert running.wait(10.0) == 130
    assert until(lambda: not is_alive(int(note.read_text())))


def is_alive(pid: int) -> bool:
    """False for one that has ended and waits to be taken note of, too."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
