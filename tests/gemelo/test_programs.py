"""Programs on a simulated rm1: taught, checked, run without a pause between legs, and under a person's hand."""

from __future__ import annotations

import doctest
import inspect
import re
import runpy
import threading
from collections import UserDict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import gemelo
import gemelo.programs
from gemelo.api.simulation import SimulatedArm
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
from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.schemas.reasons import because
from tests.gemelo.test_docstrings import OPTIONS
from tests.simulated import is_moving, make_ready, rests

LONGEST = 60.0  # [s] of one program here
ONE_STEP = 0.013  # [rad] or more than that in [m], of the coarsest joint
SHUTTLE = (Repeat(count=3, steps=(Go(state="left"), Go(state="ready"))),)


class Cell:
    """The arm with an empty folder of programs, and everything that a run has said."""

    def __init__(self, arm: SimulatedArm, folder: Path) -> None:
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
            assert self.arm.wait_for(lambda: is_moving(self.arm), 5.0)


@pytest.fixture
def cell(arm: SimulatedArm, tmp_path: Path) -> Iterator[Cell]:
    arm.move(named="ready")
    yield Cell(arm, tmp_path)
    make_ready(arm)


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
    cell: Cell,
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
    runpy.run_path(str(cell.folder / "job.py"), run_name="__main__")
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
    state = run.wait(60.0)
    assert state.status is RunStatus.STOPPED
    assert state.why == because("program.run.stopped_in_round", step="1.2", round="1", text="go state='ready'")
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
    assert run.wait(60.0).status is RunStatus.STOPPED
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
    assert run.wait(60.0).status is RunStatus.STOPPED
    assert rests(cell.arm, 1.0)
    assert cell.arm.joints != pytest.approx(cell.arm.states["ready"], abs=0.05)


def test_an_emergency_stop_fails_it_with_step_and_reason_and_a_person_starts_it_again(cell: Cell) -> None:
    run = cell.run(*SHUTTLE)
    run.start()
    cell.await_step(run, (0, 1))
    cell.arm.device.inject("estop")
    state = run.wait(60.0)
    assert state.status is RunStatus.FAILED
    assert re.match(r"step 1\.2, round 1 \(go state='ready'\): .*(?i:e-?stop|emergency)", state.message)
    cell.arm.device.inject("estop", value=0)
    cell.arm.device.reset()
    assert rests(cell.arm, 0.2)
    assert run.state == state
    assert cell.arm.wait_for(lambda: not all(cell.arm.device.state.referenced), 5.0), "the e-stop costs its reference"
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
    first, last = check.refusals[0], check.refusals[-1]
    assert (first.code, first.values) == ("program.step.failed", {"step": "2.1", "text": "go state='left'"})
    assert (last.code, last.values) == ("program.step.failed", {"step": "3", "text": "go position=(0.7, 0, 0.1)"})
    refusals = [leg.refusal for leg in check.legs if leg.refusal is not None]
    assert [reason.causes for reason in check.refusals] == [(refusal.reason,) for refusal in refusals]
    assert refusals[-1].check == "reach"
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
    assert run.wait(60.0).status is RunStatus.DONE
    again = cell.run(WaitFor(sensor="ultra", below=1.0, timeout=0.3))
    again.start()
    why = again.wait(10.0).why
    assert why is not None
    limits = {"sensor": "ultra", "value": pytest.approx(3.0, abs=0.01), "limit": 1.0, "time": 0.3}
    assert [(cause.code, cause.values) for cause in why.causes] == [("program.sensor.not_below", limits)]
