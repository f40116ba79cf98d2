"""`gemelo move` while a planner, with processes of its own, plans: what it shows, and what Ctrl-C ends."""

from __future__ import annotations

import os
import re
import signal
import threading
from collections.abc import Iterator

import pytest

import gemelo
from gemelo.api import planning
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import NamedGoal, PlanPhase, PlanProgress, PlanRequest, PlanResponse
from gemelo.schemas.scene import SceneReplace, SceneRequest
from gemelo.schemas.topics import PLAN, PLAN_PROGRESS, SCENE_EDIT
from gemelo.services.planner.core import Planner
from gemelo.services.planner.main import run
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.motion import move as move_module
from gemelo.tools.cli.motion.move import move
from tests.planner.walled import WALLED, past_the_wall
from tests.runtime.support import spinning

PATIENCE = 60.0  # [s]


@pytest.fixture
def walled(session, network, deployment) -> Iterator[None]:
    """A planner whose arm stands between walls."""
    stop = ShutdownRequest()

    def serve() -> None:
        with Node("planner", deployment, robot="rm1", bus=MemoryBus(network), stop=stop) as node:
            run(node, deployment)

    thread = threading.Thread(target=serve)
    thread.start()
    request = SceneRequest(edit=SceneReplace(scene=WALLED))
    assert session.node.call(SCENE_EDIT, request, PATIENCE).accepted
    yield
    stop.set()
    thread.join(PATIENCE)
    assert not thread.is_alive()


@pytest.fixture
def watcher(network, deployment) -> Iterator[Node]:
    """Who sees from outside how plans stand."""
    with Node("watcher", deployment, robot="rm1", bus=MemoryBus(network), stop=ShutdownRequest()) as node:
        yield node
        node.stop()


def press_when_it_searches(watcher: Node) -> None:
    """Ctrl-C, once."""
    pressed = threading.Event()

    def on_progress(progress: PlanProgress) -> None:
        if progress.phase is PlanPhase.SEARCH and not pressed.is_set():
            pressed.set()
            os.kill(os.getpid(), signal.SIGINT)

    watcher.subscribe(PLAN_PROGRESS, on_progress)
    threading.Thread(target=watcher.wait, args=(PATIENCE,), daemon=True).start()


@pytest.mark.parametrize("plan_only", [False, True])
def test_ctrl_c_while_planning_cancels_the_plan_and_nothing_moves(connected, gateway, walled, watcher, plan_only):
    press_when_it_searches(watcher)
    gateway.refusal = "nothing is to be sent here"
    with pytest.raises(
        CommandError, match=r"^the plan was cancelled after .* s, while searching: nothing moves$"
    ) as end:
        move(connected, past_the_wall(), plan_only, as_json=False)
    assert end.value.code is ExitCode.CANCELLED


def test_a_terminal_is_shown_how_planning_stands_and_nothing_of_it_stays(
    connected, gateway, walled, watcher, capsys, monkeypatch
):
    monkeypatch.setattr(move_module, "LiveBlock", lambda _is_live: LiveBlock(is_live=True))
    press_when_it_searches(watcher)
    with pytest.raises(CommandError):
        move(connected, past_the_wall(), plan_only=True, as_json=False)
    written = capsys.readouterr().out
    assert re.search(r"planning: searching, \d+\.\d of 100 s \(Ctrl-C cancels\)\n", written)
    assert written.endswith("\x1b[1F\x1b[J")


def test_a_pipe_hears_nothing_of_it(connected, gateway, walled, watcher, capsys):
    press_when_it_searches(watcher)
    with pytest.raises(CommandError):
        move(connected, past_the_wall(), plan_only=True, as_json=False)
    assert capsys.readouterr().out == ""


def test_a_plan_that_comes_too_late_is_not_left_behind(connected, gateway, walled, watcher, monkeypatch):
    monkeypatch.setattr(planning, "MARGIN", -99.0)
    heard: list[PlanProgress] = []
    watcher.subscribe(PLAN_PROGRESS, heard.append)
    with pytest.raises(gemelo.Lost, match="planner did not answer plan within 1 s"):
        move(connected, past_the_wall(), plan_only=True, as_json=False)
    watcher.wait(0.5)
    count = len(heard)
    watcher.wait(0.5)
    assert len(heard) == count


@pytest.fixture
def last_moment_planner(arm, network, deployment) -> Iterator[None]:
    """A planner that knows no cancel, and answers when a person has just pressed Ctrl-C."""
    core = Planner(arm)
    home = JointState(name=arm.joint_names, position=(0.0,) * len(arm.joints))

    def plan(request: PlanRequest) -> PlanResponse:
        made = core.plan(request, home)
        os.kill(os.getpid(), signal.SIGINT)
        return made

    with Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.serve(PLAN, plan)
        with spinning(node, rate=10.0):
            yield


def test_ctrl_c_just_as_the_plan_is_made_moves_nothing_either(connected, gateway, last_moment_planner):
    gateway.refusal = "nothing is to be sent here"
    with pytest.raises(CommandError, match=r"^cancelled when the plan was just made: nothing moves$") as end:
        move(connected, PlanRequest(goal=NamedGoal(name="ready")), plan_only=False, as_json=False)
    assert end.value.code is ExitCode.CANCELLED
    assert gateway.goals == []
