"""`gemelo bag play` by hand: paused, in single steps, faster and slower; by its keys on a terminal, and by requests."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DESCRIPTION, Delivery, Topic
from gemelo.services.state_publisher.main import describe
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.runtime.support import ROOT, spinning, until

START = 1_795_000_000_000_000_000
COUNT, PERIOD = 200, 50_000_000  # messages; [ns] between two: ten seconds
OWN = Topic("test/own", JointState, Delivery.EVERY, None, True, "tester", "a user's own")
PATIENCE = 60.0  # [s]


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """The arm, and half a second later the first of the messages, so that each is a step of its own."""
    file = McapFile(tmp_path / "bag.mcap", {})
    file.write([Entry(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")), START - PERIOD)])
    file.write(Entry(OWN, JointState(stamp=k), START + k * PERIOD) for k in range(COUNT))
    file.close()
    return file.path


class Playing:
    """The command on a terminal, paused at first, and who hears what it plays."""

    def __init__(self, bag: Path, environ: dict[str, str]) -> None:
        self.heard: list[int] = []
        self._keys, terminal = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gemelo.tools.cli.main", "bag", "play", str(bag), "--paused"], cwd=ROOT,
            env=environ, stdin=terminal, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        os.close(terminal)
        assert self.process.stdout is not None
        assert "playing as rm1-replay" in self.process.stdout.readline()
        assert "space: pause, s: one step" in self.process.stdout.readline()

    def type(self, keys: str) -> None:
        os.write(self._keys, keys.encode())

    def has_heard(self, count: int) -> bool:
        return until(lambda: len(self.heard) >= count, PATIENCE)

    def end(self) -> int:
        """Types q; how many messages it says that it has played, without the description."""
        self.type("q")
        said, _ = self.process.communicate(timeout=PATIENCE)
        played = re.search(r"played (\d+) messages", said)
        assert played is not None, said
        assert self.process.returncode == 0
        return int(played[1]) - 1

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()
        os.close(self._keys)


@pytest.fixture
def playing(router, bag, monkeypatch) -> Iterator[Playing]:
    with Node("tool", robot="rm1-replay") as tool:
        made = Playing(bag, {**os.environ, "PYTHONPATH": str(ROOT)})
        tool.subscribe(OWN, lambda state: made.heard.append(state.stamp))
        with spinning(tool):
            assert until(lambda: "player" in tool.alive(), PATIENCE)
            monkeypatch.setenv("GEMELO_ROBOT", "")  # what `--robot` sets is undone with it
            yield made
        made.close()


def parameter(capsys, *words: str) -> str:
    assert run(["--robot", "rm1-replay", "param", *words]) is ExitCode.OK
    return capsys.readouterr().out.strip()


def test_keys_step_go_on_and_pause(playing, capsys):
    playing.type("s")  # the description
    for key, count in (("s", 1), (".", 2), ("s", 3)):
        playing.type(key)
        assert playing.has_heard(count)
        assert playing.heard == list(range(count))
    playing.type(" ")
    assert playing.has_heard(10)
    playing.type(" ")
    assert until(lambda: parameter(capsys, "get", "player", "paused") == "true", PATIENCE)
    count = len(playing.heard)
    playing.type("ss")
    assert playing.has_heard(count + 2)
    assert playing.end() == len(playing.heard) == count + 2 < COUNT
    assert playing.heard == list(range(count + 2))


def test_keys_play_faster_and_slower(playing, capsys):
    for keys, rate in (("+", "2.0"), ("++", "8.0"), ("-", "4.0")):
        playing.type(keys)
        assert until(lambda rate=rate: parameter(capsys, "get", "player", "rate") == rate, PATIENCE)
    playing.type("++ ")
    assert playing.has_heard(COUNT)  # ten seconds at 16 times real time
    said, _ = playing.process.communicate(timeout=PATIENCE)
    assert f"played {COUNT + 1} messages, up to" in said


def test_requests_step_go_on_and_pause(playing, capsys):
    assert parameter(capsys, "get", "player", "paused") == "true"
    for step in (1, 2, 3):
        assert parameter(capsys, "set", "player", "step", str(step)) == f"player step: {step - 1} -> {step}"
        assert playing.has_heard(step - 1)
        assert playing.heard == list(range(step - 1))
    parameter(capsys, "set", "player", "paused", "false")
    assert playing.has_heard(10)
    parameter(capsys, "set", "player", "paused", "true")
    count = len(playing.heard)
    parameter(capsys, "set", "player", "step", "5")  # a higher number plays one more each
    assert playing.has_heard(count + 2)
    assert playing.end() == len(playing.heard) == count + 2 < COUNT
    assert playing.heard == list(range(count + 2))
