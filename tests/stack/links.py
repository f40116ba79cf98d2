"""Links that are cut or slow in the middle of a move, between four hosts with TLS, each judged by the arm itself.

`sudo .venv/bin/python -m tests.stack.links [NAME ...]` goes through all cases, or those whose names contain a NAME, and
prints the table of what came of them; tests/stack/test_links.py takes a few.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from gemelo.firmware.platform.host.slot_record import ROW, VARIABLE
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.chaos.slots import SlotFile, steps_in, violations
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.layout import processes
from tests.stack.ethernet import Ethernet
from tests.stack.link_cases import CASES, FINISHED, HELD, Case, expected, told_within
from tests.stack.namespaces import Hosts, Lab

# The board is a host of its own, as one on Wi-Fi is.
SITE = """
[router]
host = "brain"
[broker]
host = "cell"
[robots.rm1]
folder = "urdf/rm1"
[hosts.board]
address = "10.77.0.4"
[hosts.board.services]
rm1 = ["virtual_esp32"]
[hosts.cell]
address = "10.77.0.1"
[hosts.cell.services]
rm1 = ["stepper_gateway", "state_publisher"]
[hosts.brain]
address = "10.77.0.2"
[hosts.brain.services]
rm1 = ["planner"]
[hosts.desk]
address = "10.77.0.3"
roles = ["operator", "viewer"]
"""
BOARD = "gemelo-rm1-virtual_esp32"
READY = 30.0  # [s] in which all is ready again
FRESH = 3.0  # [s] that a process's word for its readiness counts: deploy/probe
TO_TELL = 90.0  # [s] in which the desk has said how it ended, or it hangs
REST = 1.0  # [s] without a step: the arm stands
WATCHED = 3.0  # [s] for which nothing may move by itself


@dataclass(frozen=True)
class Row:
    """What came of a case."""

    case: Case
    heard: str  # by the client: the goal's status, ServerLost or NoAnswer
    why: str
    told_after: float  # [s] from the beginning of the fault, by the client's clock
    told_within: float  # [s] of the same beginning: what docs/inside/failures.md allows
    arm: str  # FINISHED or HELD
    ready_after: float  # [s] from the heal until every process of every host is ready; inf: never
    again: str  # how the next move ended
    hands: tuple[str, ...]  # what a person had to do before it
    faults: tuple[str, ...]  # what must not happen

    def cells(self) -> tuple[str, ...]:
        told, ready = f"{self.told_after:.1f} of {self.told_within:.1f}", f"{self.ready_after:.1f}"
        hands, faults = ", ".join(self.hands) or "-", "; ".join(self.faults) or "-"
        return (self.case.name, self.arm, self.heard, told, ready, self.again, hands, faults)


HEADINGS = ("case", "the arm", "the client hears", "after [s]", "ready [s]", "next move", "a person had to", "faults")


class Links:
    """The site on a switch of ours, a record of the device's motors, and a person at the desk."""

    def __init__(self, folder: Path) -> None:
        file = folder / "lab.toml"
        file.write_text(SITE)
        site = load_site(file, project_root())
        self.ethernet = Ethernet()
        self._arm = load_arm(project_root() / "urdf/rm1")
        self._config = device_config(self._arm)
        self._slots = SlotFile(folder / "slots")
        self.hosts = Hosts(site, self.ethernet)
        self.lab = Lab(site, self.hosts, folder / "out")
        self._said: SimpleQueue[str] = SimpleQueue()
        self._closing = ExitStack()
        _let_record(folder / "out/board/process-compose.yaml", self._slots.path)

    def __enter__(self) -> Links:
        with ExitStack() as closing:
            closing.enter_context(self.hosts)
            closing.enter_context(self.lab)
            self._desk = closing.enter_context(subprocess.Popen(
                self.hosts.command("desk", sys.executable, "-m", "tests.stack.desk"), cwd=project_root(), text=True,
                bufsize=1, env=self.lab.environment("desk", "rm1"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            ))  # fmt: skip
            closing.callback(self._desk.kill)
            threading.Thread(target=self._listen, daemon=True).start()
            assert json.loads(self._hear())["ready"] == "SUCCEEDED", self.lab.logs()
            self._closing = closing.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._closing.close()

    def run(self, case: Case) -> Row:
        """One move with the case's fault in its middle, and one after it."""
        first = max(self._slots.size - ROW.size, 0)
        self._say("attached" if case.is_attached else "move")
        assert self._hear() == "moving\n", self.logs()
        began = time.time()
        with self.ethernet.impaired(case.host, case.out, case.into):
            if case.lasts:
                time.sleep(case.lasts)  # how long the link is down is what this is about
            else:
                heard = json.loads(self._hear())
        healed = time.monotonic()
        ready = self._wait_ready() - healed
        heard = json.loads(self._hear()) if case.lasts else heard
        self._wait_rest()
        rested = self._slots.path.stat().st_mtime - began
        faults = [str(each) for each in violations(self._config, self._slots.rows(first))]
        stood = self._slots.size
        time.sleep(WATCHED)
        if steps_in(self._slots.rows(stood)):
            faults.append("it moved by itself")
        self._say("again")
        after = json.loads(self._hear())
        came = (self._where(heard["goal"], after["stands"]), heard["status"])
        if came not in expected(case):
            faults.append(f"the arm {came[0]} and the client heard {came[1]}, which is none of {expected(case)}")
        within = told_within(case, heard["status"], rested)
        if heard["told_after"] > within:
            faults.append(f"the client heard it after {heard['told_after']:.1f} s, allowed {within:.1f} s")
        if after["again"] != "SUCCEEDED" or (after["hands"] and came[0] == FINISHED):
            faults.append(f"it is not ready again by itself: {after['why']}")
        return Row(
            case=case, heard=heard["status"], why=heard["why"], told_after=heard["told_after"],
            told_within=within, arm=came[0], ready_after=ready, again=after["again"], hands=tuple(after["hands"]),
            faults=tuple(faults),
        )  # fmt: skip

    def frozen(self, host: str, service: str) -> tuple[float, dict[str, object], list[str]]:
        """One move in whose middle a process of rm1 is stopped (SIGSTOP), and one after it.

        [s] until another process says that it is ready, what the desk says of the second move, and what must not be.
        """
        first = max(self._slots.size - ROW.size, 0)
        alive = Path(self.lab.sites[host].state, "rm1", "run", f"{service}.alive")
        self._say("move")
        assert self._hear() == "moving\n", self.logs()
        before = _first_word(alive)
        os.kill(int(before), signal.SIGSTOP)
        began = time.monotonic()
        while _first_word(alive) in ("", before):
            assert time.monotonic() - began < READY, f"{service} is not started anew\n{self.logs()}"
            time.sleep(0.1)
        ready = self._wait_ready() - began
        self._hear()
        self._wait_rest()
        faults = [str(each) for each in violations(self._config, self._slots.rows(first))]
        stood = self._slots.size
        time.sleep(WATCHED)
        if steps_in(self._slots.rows(stood)):
            faults.append("it moved by itself")
        self._say("again")
        return ready, json.loads(self._hear()), faults

    def watched(self, word: str) -> tuple[dict[str, object], list[str]]:
        """What the desk says of a move, with what the judge of slots finds in it."""
        first = max(self._slots.size - ROW.size, 0)
        self._say(word)
        assert self._hear() == "moving\n"
        came = json.loads(self._hear())
        self._wait_rest()
        return came, [str(each) for each in violations(self._config, self._slots.rows(first))]

    def logs(self) -> str:
        return self.lab.logs()

    def _where(self, goal: list[float], stands: list[float]) -> str:
        pairs = zip(self._arm.joints, goal, stands, strict=True)
        is_there = all(abs(wanted - is_at) * joint.steps.per_unit <= 1.0 for joint, wanted, is_at in pairs)
        return FINISHED if is_there else HELD

    def _wait_ready(self) -> float:
        """[s monotonic] when every process had said so anew; infinity after READY."""
        files = [
            Path(site.state, process.robot or "host", "run", f"{process.service.name}.ready")
            for name, site in self.lab.sites.items() for process in processes(site, name)
        ]  # fmt: skip
        end = time.monotonic() + READY
        while time.monotonic() < end:
            if all(file.exists() and time.time() - file.stat().st_mtime < FRESH for file in files):
                return time.monotonic()
            time.sleep(0.05)
        return float("inf")

    def _wait_rest(self) -> None:
        end = time.monotonic() + READY
        while time.monotonic() < end:
            before = self._slots.size
            time.sleep(REST)
            if not steps_in(self._slots.rows(before)):
                return
        raise AssertionError("the arm does not come to rest")

    def _listen(self) -> None:
        assert self._desk.stdout is not None
        for line in self._desk.stdout:
            self._said.put(line)

    def _say(self, word: str) -> None:
        assert self._desk.stdin is not None
        self._desk.stdin.write(f"{word}\n")

    def _hear(self) -> str:
        try:
            return self._said.get(timeout=TO_TELL)
        except Empty:
            raise AssertionError(f"the desk says nothing for {TO_TELL:g} s\n{self.lab.logs()}") from None


def _first_word(file: Path) -> str:
    """Empty without the file, or while it is written."""
    return next(iter(file.read_text().split()), "") if file.exists() else ""


def _let_record(file: Path, record: Path) -> None:
    """Has the board's process write down every slot."""
    content = json.loads(file.read_text())
    content["processes"][BOARD]["environment"].append(f"{VARIABLE}={record}")
    file.write_text(json.dumps(content))


def main(wanted: list[str]) -> int:
    """The command; 1 if a case has a fault."""
    rows = []
    with tempfile.TemporaryDirectory() as folder, Links(Path(folder)) as links:
        for case in CASES:
            if not wanted or any(each in case.name for each in wanted):
                rows.append(links.run(case))
                print("  ".join(rows[-1].cells()), f"({rows[-1].why})" * bool(rows[-1].why), flush=True)
    print(f"\n{table(HEADINGS, [row.cells() for row in rows])}")
    return int(any(row.faults or row.ready_after == float("inf") for row in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
