"""Programs on the whole stack: a process that dies under them, and `gemelo program` as a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
import gemelo.programs
from gemelo.programs import (
    Go,
    Points,
    Program,
    ProgramRun,
    Programs,
    Repeat,
    RunState,
    RunStatus,
    export_script,
)
from gemelo.programs.steps import AnyStep
from gemelo.tools.stack.stack import Stack
from tests.simulated import make_ready
from tests.stack.test_unwatched import is_moving, rests

LONGEST = 60.0  # [s] of one program here
ONE_STEP = 0.013  # [rad] or more than that in [m], of the coarsest joint
SHUTTLE = (Repeat(count=3, steps=(Go(state="left"), Go(state="ready"))),)


class Cell:
    """The arm with an empty folder of programs, and everything that a run has said."""

    def __init__(self, arm: gemelo.Arm, folder: Path) -> None:
        self.arm, self.folder = arm, folder
        self.points, self.programs = Points.load(folder, arm.description), Programs(folder)
        self.states: list[RunState] = []

    def run(self, *steps: AnyStep) -> ProgramRun:
        program = Program("job", steps)
        return ProgramRun(self.arm, program, self.points, self.programs, on_change=self.states.append)

    def await_step(self, run: ProgramRun, path: tuple[int, ...], moving: bool = True) -> None:
        """Until the run is at that step, and the arm on its way."""
        assert self.arm.wait_for(lambda: run.state.step == path, LONGEST)
        if moving:
            end = time.monotonic() + 60.0
            while not is_moving(self.arm):
                assert time.monotonic() < end


@pytest.fixture
def cell(arm: gemelo.Arm, tmp_path: Path) -> Iterator[Cell]:
    arm.move(named="ready")
    yield Cell(arm, tmp_path)
    make_ready(arm)


def cli(twin: Stack, folder: Path, *words: str) -> subprocess.Popen[str]:
    environment = {**twin.environment, "GEMELO_PATHS_PROGRAMS": str(folder)}
    command = [sys.executable, "-u", "-m", "gemelo.tools.cli.main", "program", *words]
    return subprocess.Popen(
        command, cwd=twin.root, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def test_a_gateway_that_dies_fails_it_with_its_step(cell: Cell, twin: Stack) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 1))
    twin.kill("stepper_gateway")
    state = run.wait(60.0)
    assert state.status is RunStatus.FAILED
    assert state.message.startswith("step 1.2, round 1 (go state='ready'): ")
    twin.wait_ready(120.0, ["stepper_gateway"])
    assert rests(cell.arm, 5.0)


def test_a_planner_that_dies_fails_it_with_its_step_or_is_back_in_time(cell: Cell, twin: Stack) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 0))
    twin.kill("planner")
    state = run.wait(LONGEST)
    twin.wait_ready(120.0, ["planner"])
    assert rests(cell.arm, 5.0)
    if state.status is RunStatus.FAILED:
        assert "planner" in state.message
        run.start(state.step)
        assert run.wait(LONGEST).status is RunStatus.DONE
    assert cell.arm.joints == pytest.approx(cell.arm.states["ready"], abs=ONE_STEP)


def test_a_script_that_is_killed_leaves_an_arm_that_decelerates_and_nothing_begins_again(
    cell: Cell, twin: Stack
) -> None:
    Program("job", SHUTTLE).save(cell.folder)
    with cli(twin, cell.folder, "run", "job") as process:
        cell.arm.wait_for(lambda: False, 0.1)
        assert process.stdout is not None
        assert process.stdout.readline().startswith("step 1.1, round 1: go state='left'")
        assert process.stdout.readline().startswith("step 1.2, round 1: go state='ready'")
        process.kill()
        process.wait()
    assert rests(cell.arm, 3.0)
    with cli(twin, cell.folder, "list", "--json") as process:
        listed = json.loads(process.communicate(timeout=30)[0])
    assert listed["programs"] == [{"name": "job", "steps": 3, "robot": "", "mistakes": []}]
    assert rests(cell.arm, 0.1)


def test_ctrl_c_decelerates_and_says_where_it_stopped(cell: Cell, twin: Stack) -> None:
    Program("job", SHUTTLE).save(cell.folder)
    with cli(twin, cell.folder, "run", "job", "--from", "1.2") as process:
        assert process.stdout is not None
        while not process.stdout.readline().startswith("step 1.1, round 2: go state='left'"):
            pass
        while not is_moving(cell.arm):
            pass
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (130, "")
    assert "job: stopped: stopped in step 1.1, round 2 (go state='left'); the arm is at brazo_joint " in output
    assert output.endswith("go on with: gemelo program run job --from 1.1\n")
    assert rests(cell.arm, 0.2)


def test_the_commands_check_run_and_export(cell: Cell, twin: Stack) -> None:
    Program("job", (Go(state="left"), Go(position=(0.7, 0.0, 0.1)))).save(cell.folder)
    Program("fine", (Go(state="left"), Go(state="ready"))).save(cell.folder)
    (cell.folder / "bad.toml").write_text("version = 1\nsteps = [{do = 'go', state = 'redy'}]\n")
    ended = {}
    for words in (
        ("check", "job"), ("check", "fine", "--json"), ("run", "fine", "--json"), ("run", "bad"), ("run", "fin"),
        ("run", "fine", "--from", "9"), ("run", "a/b"), ("export", "fine", str(cell.folder / "fine.py")),
        ("export", "fine", str(cell.folder / "no" / "fine.py")),
    ):  # fmt: skip
        with cli(twin, cell.folder, *words) as process:
            output, errors = process.communicate(timeout=LONGEST)
            ended[words[:2] + words[2:3] * (words[0] == "run")] = (process.returncode, output, errors)
            assert "Traceback" not in errors
    code, output, _ = ended["check", "job"]
    assert code == 1
    assert "2: go position=(0.7, 0, 0.1): refused (reach)" in output
    code, output, _ = ended["check", "fine"]
    assert (code, json.loads(output)["ok"]) == (0, True)
    code, output, _ = ended["run", "fine", "--json"]
    assert (code, json.loads(output)["status"]) == (0, "done"), ended
    code, _, errors = ended["run", "bad"]
    assert code == 1
    assert f'{cell.folder / "bad.toml"}, line 2: step 1: rm1 has no named state "redy"; did you mean "ready"?' in errors
    assert (ended["run", "fin"][0], 'did you mean "fine"?' in ended["run", "fin"][2]) == (2, True)
    assert ended["run", "fine", "--from"][0] == 2
    assert 'program "fine" has no step 9: it has 2' in ended["run", "fine", "--from"][2]
    assert ended["run", "a/b"][0] == 2
    assert (cell.folder / "fine.py").read_text() == export_script(cell.programs["fine"], {})
    assert ended["export", "fine"][0] == 2
    assert os.listdir(cell.folder).count("fine.py") == 1
