"""A viewer with a true certificate that floods the bus or stops reading: the arm moves exactly and can be stopped."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median

import pytest

from gemelo.libraries.runtime.deployment import project_root
from tests.optional import need, need_root
from tests.stack.hostile import RATE, SIZE
from tests.stack.links import Links

pytestmark = pytest.mark.alone

STOP_GOAL = 100.0  # [ms] of the median
STOPS = 3


@pytest.fixture(scope="module")
def links(tmp_path_factory) -> Iterator[Links]:
    need("mosquitto")
    need_root("tests/stack/test_hostile_viewer.py", with_taps=True)
    with Links(tmp_path_factory.mktemp("viewer")) as made:
        yield made


@contextmanager
def hostile(links: Links, what: str) -> Iterator[subprocess.Popen[str]]:
    """The viewer's process at the desk, from its first harm on."""
    keys = f"{links.lab.sites['desk'].config}/keys"
    shown = {"GEMELO_ROUTER_CERTIFICATE": f"{keys}/viewer.pem", "GEMELO_ROUTER_KEY": f"{keys}/viewer.key"}
    command = links.hosts.command("desk", sys.executable, "-m", "tests.stack.hostile", what)
    environment = links.lab.environment("desk", "rm1") | shown
    with subprocess.Popen(command, cwd=project_root(), env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert int(process.stdout.readline()) > 0
            yield process
        finally:
            process.kill()


def require_exact_and_stoppable(links: Links, capsys) -> None:
    came, faults = links.watched("move")
    assert (came["status"], came["is_exact"], faults) == ("SUCCEEDED", True, []), came
    assert came["positions_afterwards"] == 1
    answered = []
    for _ in range(STOPS):
        came, faults = links.watched("stop")
        assert (came["status"], came["stopped"], faults) == ("ABORTED", True, []), came
        answered.append(came["stop_ms"])
    with capsys.disabled():
        print(f" stop answered after {', '.join(f'{each:.1f}' for each in answered)} ms (goal {STOP_GOAL:g})", end="")
    assert median(answered) < STOP_GOAL


def test_ten_thousand_messages_a_second_of_a_viewer_neither_move_nor_disturb_the_arm(links, capsys):
    with hostile(links, "flood") as process:
        before, began = sent_by_the_desk(links), time.monotonic()
        require_exact_and_stoppable(links, capsys)
        left, seconds = sent_by_the_desk(links) - before, time.monotonic() - began
        process.kill()
        sent = [int(line) for line in process.stdout]
    rate, on_the_wire = sent[-1] / (len(sent) + 1), left / seconds / SIZE
    with capsys.disabled():
        print(f", {rate:.0f} messages a second, {on_the_wire:.0f} of them left the host", end="")
    assert len(sent) > 5
    assert rate > 0.95 * RATE
    assert on_the_wire > 0.95 * RATE


def sent_by_the_desk(links: Links) -> int:
    """[bytes] that its network device has sent so far."""
    file = "/sys/class/net/eth0/statistics/tx_bytes"
    return int(subprocess.run(links.hosts.command("desk", "cat", file), capture_output=True, check=True).stdout)


@pytest.mark.parametrize("frozen", [False, True], ids=["stalled", "frozen"])
def test_a_reader_that_stops_reading_holds_nobody_up(links, capsys, frozen):
    with hostile(links, "stalled") as process:
        if frozen:
            process.send_signal(signal.SIGSTOP)
        require_exact_and_stoppable(links, capsys)
        assert all(unread(links, process.pid)), "it has read on"
        process.send_signal(signal.SIGCONT)


def unread(links: Links, pid: int) -> list[int]:
    """[bytes] that wait in each link of the process; empty where its links were dropped."""
    said = subprocess.run(links.hosts.command("desk", "ss", "-tnpH"), capture_output=True, text=True, check=True).stdout
    return [int(line.split()[1]) for line in said.splitlines() if f"pid={pid}," in line]


def test_after_all_of_it_everything_is_ready_and_a_move_goes_on(links):
    came, faults = links.watched("move")
    assert (came["status"], faults) == ("SUCCEEDED", [])
    assert "Traceback" not in links.logs()
