"""A minute of chaos on a whole stack: every invariant holds."""

from __future__ import annotations

import json
import subprocess
import sys

import psutil
import pytest

from tests.optional import need
from tests.runtime.support import until

pytestmark = pytest.mark.alone

SEED = 1


def reported(tmp_path, pytestconfig, *options, minutes, ends):
    """The report of a run of chaos that exits with 0 within `ends` [s]."""
    command = [sys.executable, "-m", "gemelo.tools.chaos", *options, "--seed", str(SEED), "--minutes", str(minutes)]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "out")],
        cwd=pytestconfig.rootpath, capture_output=True, text=True, timeout=ends,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((tmp_path / "out/report.json").read_text())


def test_a_minute_of_chaos_violates_nothing(tmp_path, pytestconfig):
    need("mosquitto")
    command = [sys.executable, "-m", "gemelo.tools.cli.main", "chaos", "--minutes", "1", "--seed", str(SEED)]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "out")],
        cwd=pytestconfig.rootpath, capture_output=True, text=True, timeout=240.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert len(report["episodes"]) >= 4
    assert (report["states_lost"], report["violations"]) == (0, [])
    assert sum(each["slots"] for each in report["episodes"]) > 1000  # of 1 ms with a step, each within the limits
    assert (tmp_path / "out/report.html").read_text().count("<circle") == len(report["episodes"])


def test_the_clocks_of_the_host_and_of_single_processes_step_in_the_middle_of_moves(tmp_path, pytestconfig):
    options = ("--only", "clock steps", "--broker", "embedded")
    report = reported(tmp_path, pytestconfig, *options, minutes=0.3, ends=150.0)
    assert {each["fault"] for each in report["episodes"]} == {"host clock steps", "one clock steps"}
    assert all(each["ended"] == "succeeded" for each in report["episodes"])  # no motion depends on a wall clock
    assert report["states_lost"] == 0


@pytest.mark.parametrize(
    "command",
    [
        ("gemelo.tools.chaos.soak", "--broker", "embedded", "--out"),
        ("gemelo.tools.bench", "--only", "move_accept_to_first_step_ms", "--out"),
        ("gemelo.tools.demo", "--broker", "embedded", "--no-picture", "--out"),
    ],
    ids=lambda command: command[0],
)
def test_what_starts_a_stack_of_its_own_leaves_no_process_when_it_is_terminated(command, tmp_path, pytestconfig):
    with subprocess.Popen(
        [sys.executable, "-m", *command, str(tmp_path / "out")],
        cwd=pytestconfig.rootpath, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    ) as running:  # fmt: skip
        try:
            assert until(lambda: running.poll() is not None or len(all_below(running)) > 8, 60.0)
            assert running.poll() is None
            started = all_below(running)
            running.terminate()
            said = running.communicate(timeout=60.0)[1]
            assert "its stack has been stopped" in said
            assert not psutil.wait_procs(started, timeout=60.0)[1]
        finally:
            running.kill()


def all_below(running: subprocess.Popen[str]) -> list[psutil.Process]:
    return psutil.Process(running.pid).children(recursive=True)


def test_disks_that_refuse_and_processes_without_a_descriptor_end_no_move(tmp_path, pytestconfig):
    report = reported(tmp_path, pytestconfig, "--only", "run folder", minutes=0.3, ends=150.0)
    assert {each["fault"] for each in report["episodes"]} == {"run folder full", "run folder read-only"}
    assert [each["reason"] for each in report["episodes"] if each["ended"] != "succeeded"] == []


def test_twins_deafness_flutters_replays_and_a_bad_serial_line_violate_nothing(tmp_path, pytestconfig):
    names = (
        "spoiled serial line",
        "twin stepper_gateway",
        "deaf device long",
        "goal and stop",
        "goal replayed during a move",
        "SIGHUP stepper_gateway",
    )
    report = reported(tmp_path, pytestconfig, "--only", *names, "--broker", "embedded", minutes=0.8, ends=200.0)
    faults = [each["fault"] for each in report["episodes"]]
    assert len(faults) >= 3
    assert set(faults) <= set(names)
    assert (report["states_lost"], report["violations"]) == (0, [])
