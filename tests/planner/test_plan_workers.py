"""Planning in processes of their own: several at a time, stopped in time, replaced when they die."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import psutil
import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest, PlanResponse, Timing
from gemelo.schemas.scene import BoxShape, MeshShape, PlanningScene, SceneObject
from gemelo.services.planner import core
from gemelo.services.planner.core import Planner
from gemelo.services.planner.workers import worker
from gemelo.services.planner.workers import workers as module
from gemelo.services.planner.workers.jobs import Job
from gemelo.services.planner.workers.process import PlannerProcess
from gemelo.services.planner.workers.workers import Workers
from tests.descriptors import few_descriptors
from tests.planner.native.scenes import star_mesh, stl_of
from tests.planner.processes import planning_processes

PROJECT = Path(__file__).parents[2]
HOME = JointState(name=("brazo_joint", "antebrazo_joint", "efector_joint"), position=(0.0, 0.0, 0.0))
EASY = PlanRequest(goal=NamedGoal(name="ready"), start=HOME)
PATIENCE = 60.0  # [s]


class Stack:
    """Workers, and the scene that they are told."""

    def __init__(self) -> None:
        self.scene = PlanningScene(version=1)
        self.workers = Workers(PROJECT / "urdf/rm1", PROJECT, lambda: (HOME, 0.0), lambda: self.scene)
        self.answers: SimpleQueue[PlanResponse] = SimpleQueue()

    def ask(self, request: PlanRequest) -> None:
        self.workers.plan(request, self.answers.put)

    def answer(self) -> PlanResponse:
        return self.answers.get(timeout=PATIENCE)


@pytest.fixture
def stack() -> Iterator[Stack]:
    stack = Stack()
    try:
        yield stack
    finally:
        stack.workers.close()
        assert planning_processes() == []


def test_a_plan_comes_out_of_a_process_and_tells_where_its_time_went(stack: Stack):
    stack.ask(EASY)
    response = stack.answer()
    assert response.code is PlanCode.SUCCESS
    assert response.times.verification > 0.0
    assert response.times.timing > 0.0
    assert response.scene_version == 1
    assert len(planning_processes()) == 1


def test_a_process_that_dies_while_no_other_can_be_started_is_replaced_as_soon_as_one_can(stack: Stack):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    (process,) = planning_processes()
    with few_descriptors():
        os.kill(process.pid, signal.SIGKILL)
        stack.ask(EASY)
        refused = stack.answer()
    assert refused.refusal is not None
    assert "no other can be started now: Too many open files" in refused.refusal.message
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS


def test_a_change_of_the_scene_reaches_the_process(stack: Stack):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    stack.scene = PlanningScene(version=2, objects=(SceneObject(name="room", shape=BoxShape(size=(3.0, 3.0, 3.0))),))
    stack.ask(EASY)
    response = stack.answer()
    assert response.code is PlanCode.START_STATE_IN_COLLISION
    assert response.scene_version == 2


@pytest.mark.full
def test_a_large_mesh_costs_no_plan_its_time(stack: Stack):
    """Loading it takes longer than is allowed: it is done when the scene changes, or before the plan's time begins."""
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    mesh = star_mesh(np.random.default_rng(1), rings=224, sectors=224)
    rock = SceneObject(name="rock", shape=MeshShape(data=stl_of(mesh)), pose=Transform(translation=(0.0, 0.0, 3.0)))
    stack.scene = PlanningScene(version=2, objects=(rock,))
    stack.ask(EASY)
    response = stack.answer()
    assert response.code is PlanCode.SUCCESS
    assert response.scene_version == 2


def test_a_change_of_the_scene_reaches_a_process_that_has_nothing_to_do(stack: Stack, monkeypatch: pytest.MonkeyPatch):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    shown: SimpleQueue[PlanningScene] = SimpleQueue()
    show = PlannerProcess.set_scene

    def seen(process: PlannerProcess, scene: PlanningScene, *others: Callable[[], None]) -> None:
        show(process, scene, *others)
        shown.put(scene)

    monkeypatch.setattr(PlannerProcess, "set_scene", seen)
    stack.scene = PlanningScene(version=2)
    while shown.get(timeout=PATIENCE) is not stack.scene:
        pass


def test_a_change_while_a_process_plans_is_planned_for_again(stack: Stack):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    (process,) = planning_processes()
    process.suspend()
    stack.ask(PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=30.0))
    time.sleep(0.5)  # the request lies in the pipe, with the scene of before
    stack.scene = PlanningScene(version=2, objects=(SceneObject(name="room", shape=BoxShape(size=(3.0, 3.0, 3.0))),))
    process.resume()
    response = stack.answer()
    assert response.code is PlanCode.START_STATE_IN_COLLISION
    assert response.scene_version == 2


def test_a_process_that_does_not_come_back_is_killed_and_replaced(stack: Stack, monkeypatch: pytest.MonkeyPatch):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    (process,) = planning_processes()
    process.suspend()
    began = time.monotonic()
    stack.ask(PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=0.2))
    assert stack.answer().code is PlanCode.TIMED_OUT
    assert time.monotonic() - began < 0.2 + module.GRACE  # the answer does not wait for the process
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    assert not process.is_running()


def until(is_true: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not is_true():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_a_plan_whose_process_was_killed_before_is_made_by_a_new_one(stack: Stack):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    planning_processes()[0].kill()
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS


def test_a_plan_whose_process_dies_meanwhile_is_made_again_in_the_time_that_is_left(stack: Stack):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    (process,) = planning_processes()
    process.suspend()
    stack.ask(PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=30.0))
    until(lambda: any(each.elapsed > 0.1 for each in stack.workers.progress(0)))
    process.kill()
    assert stack.answer().code is PlanCode.SUCCESS
    assert not process.is_running()


def test_a_plan_that_ends_two_processes_is_refused_and_the_next_made(stack: Stack, monkeypatch: pytest.MonkeyPatch):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    plan = PlannerProcess.plan

    def killed(process: PlannerProcess, *others: Any) -> PlanResponse:
        for worker_process in planning_processes():
            worker_process.kill()
        return plan(process, *others)

    with monkeypatch.context() as killing:
        killing.setattr(PlannerProcess, "plan", killed)
        stack.ask(EASY)
        response = stack.answer()
    assert response.code is PlanCode.FAILURE
    assert response.refusal is not None
    assert response.refusal.message.startswith("2 worker processes of the planner have ended")
    assert response.refusal.remedy.startswith("plan again")
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS


def test_a_process_that_dies_idle_is_replaced_unasked_and_not_called_ready_meanwhile(stack: Stack):
    until(lambda: stack.workers.are_ready)
    (process,) = planning_processes()
    process.kill()
    until(lambda: not stack.workers.are_ready)
    until(lambda: stack.workers.are_ready)
    assert [each.pid for each in planning_processes()] != [process.pid]


@pytest.mark.parametrize("allowed", [0.0, -1.0, -1e300])
def test_a_request_without_time_is_refused_by_the_process_that_goes_on(stack: Stack, allowed: float):
    stack.ask(PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=allowed))
    refused = stack.answer()
    (process,) = planning_processes()
    assert refused.refusal is not None
    assert refused.refusal.subject == "allowed_time"
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    assert planning_processes() == [process]


@pytest.mark.parametrize("allowed", [0.1, 0.15, 0.2, 0.3, 1.0, 30.0])
def test_a_short_time_is_kept_too_and_what_the_process_says_of_being_late_comes_before_it_is_stopped(allowed: float):
    request = PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=allowed)
    assert module.longest(request) <= 1.09 * allowed
    own = module.for_process(request).allowed_time
    assert (1.0 + core.LATEST) * own + 0.5 * module.WAY <= module.longest(request)
    assert own >= 0.89 * allowed


def test_a_defect_costs_the_plan_and_not_the_process():
    class Broken(Planner):
        def plan(self, *_args: object) -> PlanResponse:
            raise ZeroDivisionError("nothing divides")

    response = worker.run_plan(Broken(load_arm(PROJECT / "urdf/rm1")), worker.RunningJob(Job(request=EASY)))
    assert response.code is PlanCode.FAILURE
    assert response.refusal is not None
    assert "ZeroDivisionError: nothing divides" in response.refusal.message


def test_one_client_does_not_block_another(stack: Stack):
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    (first,) = planning_processes()
    first.suspend()
    stack.ask(PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=30.0))
    stack.ask(EASY)
    assert stack.answer().code is PlanCode.SUCCESS
    assert len(planning_processes()) == 2
    first.resume()
    assert stack.answer().code is PlanCode.SUCCESS


def test_nothing_is_left_of_a_planner_that_is_killed_while_it_plans():
    code = (
        "import time; from pathlib import Path; from gemelo.schemas.planning import *;"
        "from gemelo.schemas.joints import JointState; from gemelo.schemas.scene import PlanningScene;"
        "from gemelo.services.planner.workers.workers import Workers;"
        f"scene = PlanningScene(); project = Path({str(PROJECT)!r});"
        "w = Workers(project / 'urdf/rm1', project, lambda: (None, 0.0), lambda: scene);"
        f"home = JointState(name={HOME.name!r}, position=(0.0, 0.0, 0.0));"
        "w.plan(PlanRequest(goal=NamedGoal(name='ready'), start=home), lambda r: print('planned', flush=True));"
        "time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=PROJECT, stdout=subprocess.PIPE) as planner:
        assert planner.stdout is not None
        assert planner.stdout.readline() == b"planned\n"
        (orphan,) = planning_processes(planner.pid)
        os.kill(planner.pid, signal.SIGKILL)
        assert psutil.wait_procs([orphan], timeout=60.0)[1] == []


@pytest.mark.full
def test_the_first_time_optimal_plan_is_not_stopped_while_its_library_loads(stack: Stack):
    stack.ask(PlanRequest(goal=NamedGoal(name="ready"), start=HOME, timing=Timing.TIME_OPTIMAL))
    assert stack.answer().code is PlanCode.SUCCESS
