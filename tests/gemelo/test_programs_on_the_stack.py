"""Programs on the whole stack of rm1: taught, checked, run without a pause between legs, and under a person's hand."""

from __future__ import annotations

import doctest
import inspect
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections import UserDict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import gemelo
import gemelo.programs
from gemelo.programs import (
    Arc,
    Attach,
    Detach,
    Go,
    Line,
    Point,
    Points,
    Program,
    ProgramRun,
    Programs,
    Repeat,
    RunState,
    RunStatus,
    Speed,
    Wait,
    WaitFor,
    check_program,
    export_script,
)
from gemelo.programs.steps import AnyStep
from schemas.device import DeviceMode, DeviceState
from services.stack.stack import Stack
from tests.gemelo.conftest import make_ready
from tests.gemelo.test_docstrings import OPTIONS
from tests.gemelo.test_unwatched import is_moving, rests

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
            end = time.monotonic() + 5.0
            while not is_moving(self.arm):
                assert time.monotonic() < end


@pytest.fixture
def cell(arm: gemelo.Arm, tmp_path: Path) -> Iterator[Cell]:
    arm.move(named="ready")
    yield Cell(arm, tmp_path)
    make_ready(arm)


def cli(twin: Stack, folder: Path, *words: str) -> subprocess.Popen[str]:
    environment = {**twin.environment, "GEMELO_PATHS_PROGRAMS": str(folder)}
    command = [sys.executable, "-u", "-m", "services.cli.main", "program", *words]
    return subprocess.Popen(
        command, cwd=twin.root, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


NAMES = [name for name in gemelo.programs.__all__ if ">>>" in (inspect.getdoc(getattr(gemelo.programs, name)) or "")]


@pytest.mark.parametrize("name", NAMES)
def test_an_example_in_a_docstring_does_what_it_shows(name: str, arm: gemelo.Arm, tmp_path: Path) -> None:
    text = inspect.getdoc(getattr(gemelo.programs, name)) or ""
    names = {"gemelo": gemelo, "arm": arm, "folder": str(tmp_path)}
    said: list[str] = []
    test = doctest.DocTestParser().get_doctest(text, names, name, None, 0)
    results = doctest.DocTestRunner(optionflags=OPTIONS).run(test, out=said.append)
    assert results.attempted > 0
    assert results.failed == 0, "".join(said)


def test_three_points_are_taught_run_changed_and_run_again_and_the_script_ends_there_too(
    cell: Cell, twin: Stack
) -> None:
    arm, points = cell.arm, cell.points
    for name, angle in (("one", 0.2), ('it\'s "two"', 0.4), ("three", 0.7)):
        points.remember(name, {**arm.states["ready"], "brazo_joint": angle})
    steps = (
        Speed(share=0.8), Go(point="one", blend=0.02), Go(point="it's \"two\""), Wait(time=0.1),
        Go(position=(0.2, 0.3, 0.12)), Line(offset=(0.0, 0.0, -0.02), tool_speed=0.05), Line(offset=(0.0, 0.0, 0.02)),
        Arc(through=(0.15, 0.34, 0.12), position=(0.1, 0.35, 0.12)), Go(point="three"),
        Repeat(count=2, steps=(Go(joints={"efector_joint": 0.1}), Go(state="ready"))), Go(point="one"),
    )  # fmt: skip
    run = cell.run(*steps)
    run.start()
    assert run.wait(LONGEST).status is RunStatus.DONE
    assert arm.joints["brazo_joint"] == pytest.approx(0.2, abs=ONE_STEP)
    points.remember("one", {**arm.states["ready"], "brazo_joint": -0.3}, overwrite=True)
    run.start()
    assert run.wait(LONGEST).status is RunStatus.DONE
    ended = arm.joints
    assert ended["brazo_joint"] == pytest.approx(-0.3, abs=ONE_STEP)
    (cell.folder / "job.py").write_text(export_script(Program("job", steps), points))
    arm.move(named="home")
    command = [sys.executable, str(cell.folder / "job.py")]
    subprocess.run(
        command, cwd=twin.root, env={**twin.environment, "PYTHONPATH": str(twin.root)}, check=True, timeout=90
    )
    assert arm.joints == ended


class StopsWhenRead(UserDict[str, Point]):
    """Points at whose sight somebody presses Stop: in the middle of a start."""

    run: ProgramRun | None = None

    def __iter__(self) -> Iterator[str]:
        if self.run is not None:
            self.run.stop()
        return super().__iter__()


def test_a_stop_in_the_middle_of_a_start_lets_nothing_begin(cell: Cell) -> None:
    points, before = StopsWhenRead(), cell.arm.joints
    run = points.run = ProgramRun(cell.arm, Program("job", (Go(state="left"),)), points, cell.programs)
    run.start()
    assert run.wait(LONGEST).status is RunStatus.STOPPED
    assert cell.arm.joints == before
    points.run = None
    run.start()
    assert run.wait(LONGEST).status is RunStatus.DONE


def test_the_check_says_what_the_run_then_does_and_the_arm_does_not_wait_between_legs(cell: Cell) -> None:
    arm = cell.arm
    program = Program("job", SHUTTLE)
    check = check_program(arm, program, cell.points, cell.programs)
    assert check.ok
    assert [leg.path for leg in check.legs][:2] == [(0, 0), (0, 1)]
    assert sum(leg.times for leg in check.legs) == 6
    assert set(check.margins) == set(arm.joint_names)
    assert all(0.0 <= margin < 1.0 for margin in check.margins.values())
    heard: list[DeviceState] = []
    arm.node.subscribe(gemelo.topics.DEVICE_STATE, heard.append)
    run = cell.run(*SHUTTLE)
    run.start()
    assert run.wait(LONGEST).status is RunStatus.DONE
    # One stream, whose slots follow one another without a gap: a new one would begin after a rest.
    streams = {state.stream for state in heard if state.mode is gemelo.DeviceMode.RUN}
    assert len(streams) == 1
    assert max(state.play_time for state in heard if state.stream in streams) == pytest.approx(check.duration, abs=0.01)
    assert run.state.done == 6
    told = [state.step for state in cell.states if state.steps]
    assert [step for step, before in zip(told, [(), *told], strict=False) if step != before] == [(0, 0), (0, 1)] * 3


def test_it_pauses_between_steps_goes_step_by_step_and_holds_on_its_path(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 0))
    run.pause()
    paused = run.wait(LONGEST)
    assert (paused.status, paused.step, paused.done) == (RunStatus.PAUSED, (0, 1), 1)
    assert cell.arm.joints == pytest.approx(cell.arm.states["left"], abs=ONE_STEP)
    assert rests(cell.arm, 0.1)
    run.step()
    assert run.wait(LONGEST).done == 2
    assert rests(cell.arm, 0.1)
    run.resume()
    cell.await_step(run, (0, 0))
    run.hold()
    assert run.state.status is RunStatus.PAUSED
    assert rests(cell.arm, 2.0)
    assert cell.arm.joints != pytest.approx(cell.arm.states["left"], abs=2 * ONE_STEP)
    run.resume()
    assert run.wait(LONGEST).status is RunStatus.DONE
    assert run.state.done == 6


def test_a_hold_while_a_motion_is_just_being_started_holds_it(cell: Cell, monkeypatch: pytest.MonkeyPatch) -> None:
    start, is_started, is_held = cell.arm.start, threading.Event(), threading.Event()

    def start_slowly(plan: gemelo.Plan, **options: Any) -> gemelo.Motion:
        motion = start(plan, **options)
        is_started.set()
        is_held.wait(LONGEST)
        return motion

    monkeypatch.setattr(cell.arm, "start", start_slowly)
    run = cell.run(*SHUTTLE)
    run.start()
    assert is_started.wait(LONGEST)
    run.hold()
    is_held.set()
    assert run.state.status is RunStatus.PAUSED
    assert cell.arm.wait_for(lambda: cell.arm.device.state.mode is DeviceMode.HOLD, LONGEST)
    assert rests(cell.arm, 0.3)
    run.resume()
    assert run.wait(LONGEST).status is RunStatus.DONE


def test_a_stop_decelerates_and_nothing_begins_again_by_itself(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 1))
    run.stop()
    state = run.wait(5.0)
    assert state.status is RunStatus.STOPPED
    assert state.message == "stopped in step 1.2, round 1 (go state='ready')"
    assert rests(cell.arm, 0.2)
    with pytest.raises(gemelo.Error, match="is stopped, not paused"):
        run.resume()
    run.start((0, 1))
    assert run.wait(LONGEST).status is RunStatus.DONE


def test_a_held_program_is_stopped_where_it_stands(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 0))
    run.hold()
    assert rests(cell.arm, 2.0)
    where = cell.arm.joints
    run.stop()
    assert run.wait(5.0).status is RunStatus.STOPPED
    assert cell.arm.joints == pytest.approx(where, abs=ONE_STEP)
    assert cell.arm.device.mode is gemelo.DeviceMode.IDLE


def test_a_stop_while_the_next_leg_is_handed_over_already_stops_both(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 0))
    execution = run.execution
    assert execution is not None
    assert cell.arm.wait_for(
        lambda: execution.following is not None and execution.following.motion is not None, LONGEST
    )
    run.stop()
    assert run.wait(5.0).status is RunStatus.STOPPED
    assert rests(cell.arm, 1.0)
    assert cell.arm.joints != pytest.approx(cell.arm.states["ready"], abs=0.05)


def test_an_emergency_stop_fails_it_with_step_and_reason_and_a_person_starts_it_again(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 1))
    cell.arm.device.inject("estop")
    state = run.wait(5.0)
    assert state.status is RunStatus.FAILED
    assert re.match(r"step 1\.2, round 1 \(go state='ready'\): .*(?i:e-?stop|emergency)", state.message)
    cell.arm.device.inject("estop", value=0)
    cell.arm.device.reset()
    assert rests(cell.arm, 0.2)
    assert run.state == state
    end = time.monotonic() + 5.0
    while all(cell.arm.device.state.referenced):  # until it says that the e-stop has cost it its reference
        assert time.monotonic() < end
    make_ready(cell.arm)
    run.start(state.step)
    assert run.wait(LONGEST).status is RunStatus.DONE


def test_a_leg_that_cannot_be_is_found_by_the_check_and_by_the_run_at_its_step(cell: Cell) -> None:
    cell.arm.scene.add_box("wall", size=(0.1, 0.1, 0.6), at=(0.0, 0.33, 0.1))
    steps = (
        Go(state="home"),
        Repeat(count=2, steps=(Go(state="left"), Go(state="ready"))),
        Go(position=(0.7, 0.0, 0.1)),
    )
    check = check_program(cell.arm, Program("job", steps), cell.points, cell.programs)
    assert {leg.path for leg in check.legs if not leg.ok} == {(1, 0), (1, 1), (2,)}
    assert "step 2.1 (go state='left'): refused" in check.refusals[0]
    assert "step 3 (go position=(0.7, 0, 0.1)): refused (reach)" in check.refusals[-1]
    run = cell.run(*steps)
    run.start()
    state = run.wait(LONGEST)
    assert (state.status, state.step, state.done) == (RunStatus.FAILED, (1, 0), 1)
    assert "wall" in state.message
    assert cell.arm.joints == pytest.approx(cell.arm.states["home"], abs=ONE_STEP)


def test_a_scene_that_changes_under_way_is_planned_around_or_refused(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 0))
    cell.arm.scene.add_sphere("ball", radius=0.02, at=(0.0, 0.0, 0.9))  # in nobody's way
    assert run.wait(LONGEST).status is RunStatus.DONE


def test_objects_are_carried_and_put_down(cell: Cell) -> None:
    arm = cell.arm
    arm.scene.add_sphere("ball", radius=0.01, at=arm.pose().offset(z=-0.03).position)
    run = cell.run(Attach(object="ball"), Go(state="left"), Detach(object="ball"), Go(state="ready"))
    run.start()
    assert run.wait(LONGEST).status is RunStatus.DONE
    assert not arm.scene.objects["ball"].attached
    assert arm.scene.objects["ball"].pose.translation != pytest.approx(arm.pose().offset(z=-0.03).position, abs=0.05)


def test_a_sensor_is_waited_for_and_its_time_runs_out(cell: Cell) -> None:
    cell.arm.device.inject("sensor", "ultra", 0.25)
    run = cell.run(WaitFor(sensor="ultra", above=1.0, timeout=20.0))
    run.start()
    cell.await_step(run, (0,), moving=False)
    cell.arm.device.inject("sensor", "ultra", 3.0)
    assert run.wait(10.0).status is RunStatus.DONE
    again = cell.run(WaitFor(sensor="ultra", below=1.0, timeout=0.3))
    again.start()
    assert again.wait(10.0).message.endswith("not below 1, after 0.3 s")


def test_a_gateway_that_dies_fails_it_with_its_step(cell: Cell, twin: Stack) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 1))
    twin.kill("stepper_gateway")
    state = run.wait(10.0)
    assert state.status is RunStatus.FAILED
    assert state.message.startswith("step 1.2, round 1 (go state='ready'): ")
    twin.wait_ready(20.0, ["stepper_gateway"])
    assert rests(cell.arm, 5.0)


def test_a_planner_that_dies_fails_it_with_its_step_or_is_back_in_time(cell: Cell, twin: Stack) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 0))
    twin.kill("planner")
    state = run.wait(LONGEST)
    twin.wait_ready(20.0, ["planner"])
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
