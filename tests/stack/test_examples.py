"""The examples that are nodes of their own, and the project's programs, on the whole stacks of both arms."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

import gemelo
from gemelo.tools.stack.stack import Stack
from tests.stacks.shared import found_by_scripts

LONGEST = 90.0  # [s] of one example
PLANNER = r"SUCCEEDED  \(.*\)"  # the last line of the one that asks its own planner
NODES = {  # what one line of each says, for as long as it runs
    "10_joint_monitor": r"(\w+ [+-]\d\.\d{4}(  )?)+",
    "11_tool_pose": r"x [+-]\d\.\d{4}  y [+-]\d\.\d{4}  z [+-]\d\.\d{4} m",
}


def start(twin: Stack, name: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-u", f"examples/{name}.py"],
        cwd=twin.root, env={**os.environ, **twin.deployment}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


class OnAnArm:
    """The same on each arm."""

    def test_a_planner_of_ones_own_is_asked(self, twin: Stack, arm: gemelo.Arm) -> None:
        with start(twin, "13_custom_planner") as process:
            try:
                output, errors = process.communicate(timeout=LONGEST)
            finally:
                process.kill()
        assert (process.returncode, errors) == (0, "")
        assert re.fullmatch(PLANNER, output.splitlines()[-1]), output
        assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9

    def test_the_programs_of_the_project_are_checked_and_run(self, twin: Stack, arm: gemelo.Arm) -> None:
        arm.move(named="ready")
        for words, end in (("check", "it can run, "), ("run", "done, 10 steps")):
            command = [sys.executable, "-m", "gemelo.tools.cli.main", "program", words, "tour"]
            programs = {"GEMELO_PATHS_PROGRAMS": str(twin.root / "programs")}
            done = subprocess.run(
                command, cwd=twin.root, env={**os.environ, **twin.deployment, **programs}, capture_output=True,
                text=True, timeout=LONGEST, check=True,
            )  # fmt: skip
            assert done.stderr == ""
            assert done.stdout.splitlines()[-1].startswith(f"tour: {end}")

    @pytest.mark.parametrize("name", NODES)
    def test_a_node_says_what_it_hears_until_it_is_stopped(self, twin: Stack, arm: gemelo.Arm, name: str) -> None:
        with start(twin, name) as process:
            assert process.stdout is not None
            try:
                line = process.stdout.readline().rstrip("\n")
                process.send_signal(signal.SIGTERM)
                _, errors = process.communicate(timeout=60.0)
            finally:
                process.kill()
        assert re.fullmatch(NODES[name], line), (line, errors)
        assert process.returncode == 0

    def test_the_feedback_monitor_follows_a_motion(self, twin: Stack, arm: gemelo.Arm) -> None:
        with start(twin, "12_feedback_monitor") as process:
            assert process.stdout is not None
            try:
                while "feedback_monitor" not in arm.node.alive():
                    assert process.poll() is None
                arm.move(named="left")
                arm.move(named="home")
                line = process.stdout.readline()
                process.send_signal(signal.SIGTERM)
                output, _ = process.communicate(timeout=60.0)
            finally:
                process.kill()
        assert re.fullmatch(r"point \d+ of \d+, \d+\.\d\d of \d+\.\d\d s, error \d\.\d{5}\n", line)
        assert process.returncode == 0
        assert "SUCCEEDED" in output


class TestRm1(OnAnArm):
    @pytest.fixture
    def twin(self, rm1_stack: Stack) -> Iterator[Stack]:
        with found_by_scripts(rm1_stack):
            yield rm1_stack


class TestParol6(OnAnArm):
    @pytest.fixture
    def twin(self, parol6_stack: Stack) -> Iterator[Stack]:
        with found_by_scripts(parol6_stack):
            yield parol6_stack
