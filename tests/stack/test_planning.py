"""Planning through the whole stack: cancelled by a person, cut off by a kill, and held against the scene at Execute."""

from __future__ import annotations

import re
import signal
import subprocess
import time

import psutil
import pytest

from gemelo.libraries.runtime.errors import GoalRefused, NoAnswer
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.planning import PlanCancel, PlanPhase, PlanProgress
from gemelo.schemas.scene import PlanningScene, SceneAdd, SceneObject, SceneReplace, SceneRequest, SphereShape
from gemelo.schemas.topics import PLAN, PLAN_CANCEL, PLAN_PROGRESS, SCENE_EDIT
from tests.planner.walled import NAMES, WALLED, past_the_wall


def typed(values):
    """Values of all joints [rad] or [m] as `--joints` takes them."""
    return [f"{name}={value}{unit}" for name, value, unit in zip(NAMES, values, ("rad", "rad", "m"), strict=True)]


GOAL = typed(past_the_wall().goal.position)
PATIENCE = 20.0  # [s]


def show(operator, scene):
    response = operator.node.call(SCENE_EDIT, SceneRequest(edit=SceneReplace(scene=scene)), timeout=60.0)
    assert response.accepted, response.reason


@pytest.fixture
def walled(operator):
    """Where the walls' plan begins, with the walls around it."""
    there = typed(past_the_wall().start.position)
    move = [operator.stack.root / ".venv/bin/gemelo", "move", "--joints", *there]
    subprocess.run(move, cwd=operator.stack.root, env=operator.stack.environment, check=True, timeout=30)
    show(operator, WALLED)
    yield operator
    operator.stack.wait_ready(PATIENCE, ["planner"])
    show(operator, PlanningScene())


@pytest.fixture
def progress(operator):
    heard: list[PlanProgress] = []
    operator.node.subscribe(PLAN_PROGRESS, heard.append)
    return heard


def searches(progress):
    return any(each.phase is PlanPhase.SEARCH for each in progress)


def test_ctrl_c_ends_a_plan_of_the_command_line_and_the_arm_stays(stack, walled, progress):
    command = [stack.root / ".venv/bin/gemelo", "move", "--joints", *GOAL, "--time", "60"]
    with subprocess.Popen(
        command, cwd=stack.root, env=stack.environment, text=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as client:  # fmt: skip
        assert walled.wait_for(lambda: searches(progress), PATIENCE)
        client.send_signal(signal.SIGINT)
        out, error = client.communicate(timeout=PATIENCE)
    assert client.returncode == 130
    assert re.fullmatch(
        r"understood: brazo_joint \S+ deg, antebrazo_joint \S+ deg, efector_joint \S+ mm; .* 60 s\n", out
    )
    assert re.fullmatch(r"gemelo: the plan was cancelled after \d+\.\d\d s, while searching: nothing moves\n", error)
    assert not walled.is_moving()


def test_a_planner_that_is_killed_while_it_plans_is_there_again_with_its_scene(stack, walled, progress):
    planner = psutil.Process(stack.pids()["planner"])
    workers = planner.children()
    killed = []

    def kill_once():
        if searches(progress) and not killed:
            stack.kill("planner")
            killed.append(time.monotonic())

    with pytest.raises(NoAnswer):
        walled.node.call(PLAN, past_the_wall("cut off", allowed=60.0), timeout=30.0, on_tick=kill_once)
    assert time.monotonic() - killed[0] < PATIENCE
    assert workers
    assert psutil.wait_procs(workers, timeout=60.0)[1] == []
    stack.wait_ready(PATIENCE, ["planner"])
    progress.clear()
    ended = []

    def end_once():
        if searches(progress) and not ended:
            ended.append(walled.node.call(PLAN_CANCEL, PlanCancel(request_id="again"), timeout=5.0).found)

    response = walled.node.call(PLAN, past_the_wall("again", allowed=60.0), timeout=65.0, on_tick=end_once)
    assert response.refusal.message.endswith("while searching")
    assert ended == [True]


def test_a_plan_made_before_an_edit_is_refused_and_one_made_before_a_restart_is_not(stack, operator):
    early = operator.plan()
    ball = SceneObject(name="ball", shape=SphereShape(radius=0.01))
    assert operator.node.call(SCENE_EDIT, SceneRequest(edit=SceneAdd(object=ball)), timeout=60.0).accepted
    with pytest.raises(
        GoalRefused, match=r"planned in scene version \d+, the scene is version \d+ now: plan again"
    ) as no:
        operator.send(early)
    assert no.value.code == FollowErrorCode.SCENE_CHANGED
    late = operator.plan()
    assert late.scene_version == early.scene_version + 1
    stack.kill("planner")
    stack.wait_ready(PATIENCE, ["planner"])
    assert operator.send(late).wait(late.duration + 10.0).status is GoalStatusCode.SUCCEEDED
    show(operator, PlanningScene())
