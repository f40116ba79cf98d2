"""A minute of chaos on a whole stack: every invariant holds."""

from __future__ import annotations

import json
import subprocess
import sys

import psutil

from tests.optional import need
from tests.runtime.support import until

SEED = 1


def test_a_minute_of_chaos_violates_nothing(tmp_path, pytestconfig):
    need("mosquitto")
    command = [sys.executable, "-m", "services.cli.main", "chaos", "--minutes", "1", "--seed", str(SEED)]
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
    command = [
        sys.executable,
        "-m",
        "services.chaos",
        "--only",
        "clock steps",
        "--broker",
        "amqtt",
        "--seed",
        str(SEED),
    ]
    done = subprocess.run(
        [*command, "--minutes", "0.3", "--out", str(tmp_path / "out")],
        cwd=pytestconfig.rootpath, capture_output=True, text=True, timeout=150.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert {each["fault"] for each in report["episodes"]} == {"host clock steps", "one clock steps"}
    assert all(each["ended"] == "succeeded" for each in report["episodes"])  # no motion depends on a wall clock
    assert report["states_lost"] == 0


def test_a_soak_that_is_terminated_leaves_no_process(tmp_path, pytestconfig):
    soak = subprocess.Popen(
        [sys.executable, "-m", "services.chaos.soak", "--broker", "amqtt", "--out", str(tmp_path)],
        cwd=pytestconfig.rootpath, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert until(lambda: list(tmp_path.rglob("*.mcap")) or soak.poll() is not None, 60.0)
        assert soak.poll() is None
        started = psutil.Process(soak.pid).children(recursive=True)
        assert len(started) > 5
        soak.terminate()
        assert "its stack has been stopped" in soak.communicate(timeout=60.0)[1]
        assert not psutil.wait_procs(started, timeout=10.0)[1]
    finally:
        soak.kill()
