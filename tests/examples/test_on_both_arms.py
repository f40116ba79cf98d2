"""Every example on the whole stack of both arms: it ends by itself, says what it shows, and complains of nothing."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

import gemelo
from services.stack.stack import Stack
from tests.gemelo.conftest import make_ready
from tests.stacks.shared import BROKER, NEEDED

LONGEST = 90.0  # [s] of one example
SHOWS = {  # what the last line of each says
    "01_move": r"the tool is at -?\d\.\d{3} -?\d\.\d{3} -?\d\.\d{3} m",
    "02_plan_and_execute": r"<Motion \w+: named='home', .*succeeded in .*>",
    "03_watch_and_cancel": r"it stands at \{.*\}",
    "04_refused": r"<Motion \w+: position=\(.*\), succeeded in .*>",
    "05_scene": r"<Motion \w+: named='ready', seed=1, succeeded in .*>",
    "06_jog": r"the tool went up \d+\.\d mm",
    "07_device": r"IDLE",
    "08_stream": r"largest step error: 0\.\d+",
    "09_pick_and_place": r"home: straight, .* 0 steps lost",
    "13_custom_planner": r"SUCCEEDED  \(.*\)",
    "15_program": r"done: 6 steps, \d+\.\d s planned",
}
NODES = {  # what one line of each says, for as long as it runs
    "10_joint_monitor": r"(\w+ [+-]\d\.\d{4}(  )?)+",
    "11_tool_pose": r"x [+-]\d\.\d{4}  y [+-]\d\.\d{4}  z [+-]\d\.\d{4} m",
}


@pytest.fixture(scope="module", params=["rm1", "parol6"])
def twin(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    environment, out = {"GEMELO_ROBOT": f"urdf/{request.param}"}, tmp_path_factory.mktemp("out")
    with (
        Stack(broker=BROKER, out=out, processes=NEEDED, environment=environment) as stack,
        pytest.MonkeyPatch.context() as patch,
    ):
        for name, value in stack.deployment.items():
            patch.setenv(name, value)
        yield stack


@pytest.fixture
def arm(twin: Stack) -> Iterator[gemelo.Arm]:
    with gemelo.connect(timeout=10.0) as connected:
        make_ready(connected)
        yield connected


def start(twin: Stack, name: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-u", f"examples/{name}.py"],
        cwd=twin.root, env={**os.environ, **twin.deployment}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


@pytest.mark.parametrize("name", SHOWS)
def test_a_script_ends_by_itself_and_shows_what_it_says(twin: Stack, arm: gemelo.Arm, name: str) -> None:
    with start(twin, name) as process:
        try:
            output, errors = process.communicate(timeout=LONGEST)
        finally:
            process.kill()
    assert (process.returncode, errors) == (0, "")
    assert re.fullmatch(SHOWS[name], output.splitlines()[-1]), output
    assert arm.scene.objects == {}
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9


def test_the_programs_of_the_project_are_checked_and_run(twin: Stack, arm: gemelo.Arm) -> None:
    arm.move(named="ready")
    for words, end in (("check", "it can run, "), ("run", "done, 10 steps")):
        command = [sys.executable, "-m", "services.cli.main", "program", words, "tour"]
        done = subprocess.run(
            command, cwd=twin.root, env={**os.environ, **twin.deployment}, capture_output=True, text=True,
            timeout=LONGEST, check=True,
        )  # fmt: skip
        assert done.stderr == ""
        assert done.stdout.splitlines()[-1].startswith(f"tour: {end}")


@pytest.mark.parametrize("name", NODES)
def test_a_node_says_what_it_hears_until_it_is_stopped(twin: Stack, arm: gemelo.Arm, name: str) -> None:
    with start(twin, name) as process:
        assert process.stdout is not None
        try:
            line = process.stdout.readline().rstrip("\n")
            process.send_signal(signal.SIGTERM)
            _, errors = process.communicate(timeout=10.0)
        finally:
            process.kill()
    assert re.fullmatch(NODES[name], line), (line, errors)
    assert process.returncode == 0


def test_the_feedback_monitor_follows_a_motion(twin: Stack, arm: gemelo.Arm) -> None:
    with start(twin, "12_feedback_monitor") as process:
        assert process.stdout is not None
        try:
            while "feedback_monitor" not in arm.node.alive():
                assert process.poll() is None
            arm.move(named="left")
            arm.move(named="home")
            line = process.stdout.readline()
            process.send_signal(signal.SIGTERM)
            output, _ = process.communicate(timeout=10.0)
        finally:
            process.kill()
    assert re.fullmatch(r"point \d+ of \d+, \d+\.\d\d of \d+\.\d\d s, error \d\.\d{5}\n", line)
    assert process.returncode == 0
    assert "SUCCEEDED" in output
