"""Two of one kind: what chaos starts beside what lives, and how it sees that one of both gives way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gemelo.schemas.reasons import because
from gemelo.tools.chaos import twins
from gemelo.tools.chaos.twins import TwinClient, TwinProcess
from tests.broker.running import Client, RunningBroker

GIVES_WAY = "print('another node is alive')"
SILENT = "pass"
FAILS = "raise ValueError('no')"
STAYS = """
import os, pathlib, time
pathlib.Path(os.environ["ALIVE"]).write_text(f"{os.getpid()} 7")
time.sleep(60)
"""


class StackOf:
    """A stack whose process "planner" is any program, and whose own is a process of this test."""

    def __init__(self, folder: Path, program: str) -> None:
        self.root = self.run = folder
        self.out = folder
        self.environment = os.environ | {"ALIVE": str(folder / "planner.alive")}
        (folder / "logs").mkdir()
        file = folder / ".venv/bin/gemelo-planner"
        file.parent.mkdir(parents=True)
        file.write_text(f"#!{sys.executable}\n{program}\n")
        file.chmod(0o755)
        self.own = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])

    def pid(self, name: str) -> int:
        return self.own.pid if self.own.poll() is None else 0


Started = Callable[[str], tuple[StackOf, TwinProcess]]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Started]:
    made: list[tuple[StackOf, TwinProcess]] = []

    def start(program: str) -> tuple[StackOf, TwinProcess]:
        stack: Any = StackOf(tmp_path, program)
        twin = TwinProcess(stack, "planner")
        twin.start()
        made.append((stack, twin))
        return stack, twin

    yield start
    for stack, twin in made:
        twin.end()
        stack.own.kill()
        stack.own.wait()


def test_a_second_one_that_ends_with_a_sentence_gives_way(started: Started) -> None:
    _, twin = started(GIVES_WAY)
    assert twin.gave_way() == []


@pytest.mark.parametrize("program", [SILENT, FAILS], ids=["without a word", "with a traceback"])
def test_a_second_one_that_ends_without_a_sentence_is_seen(started: Started, program: str) -> None:
    _, twin = started(program)
    (found,) = twin.gave_way()
    assert found.code == "chaos.twin.silent"
    assert str(found).startswith("a second planner ended without a sentence: ")


def test_two_that_go_on_are_seen_and_the_second_one_ends_with_chaos(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(twins, "TO_GIVE_WAY", 0.3)
    _, twin = started(STAYS)
    assert twin.has_begun()
    assert twin.gave_way() == [because("chaos.twin.beside", name="planner", time=0.3)]
    assert twin.one_is_left() == [because("chaos.twin.both", name="planner", time=0.3)]
    twin.end()
    assert twin.has_ended


def test_a_first_one_that_ends_for_a_later_one_is_seen_unless_it_was_frozen(started: Started) -> None:
    stack, twin = started(STAYS)
    assert twin.has_begun()
    stack.own.send_signal(signal.SIGKILL)
    stack.own.wait()
    assert twin.one_is_left() == []
    twin.end()
    (found,) = (each for each in twin.gave_way() if each.code == "chaos.twin.first_ended")
    assert str(found) == "planner has ended for a second one that started after it"


def test_a_second_one_that_ends_at_once_has_not_begun(started: Started) -> None:
    _, twin = started(GIVES_WAY)
    assert not twin.has_begun()


def test_a_client_with_the_id_of_another_takes_its_connection(tmp_path: Path) -> None:
    broker = RunningBroker("embedded", tmp_path).wait_ready()
    first = Client(broker.port, "gemelo-device-rm1-0123", "5").connected()
    twin = TwinClient(broker.port, "gemelo-device-rm1-0123", comes_back=False)
    assert first.ends.get(timeout=60.0) != 0
    first.close()
    twin.close()
    broker.stop()
