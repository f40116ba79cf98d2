"""What the page's buttons do on a whole stack, and what it says then: the page's own server, and a browser that does
not draw."""

from __future__ import annotations

import logging
import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees

import pytest

import gemelo
from schemas.joints import JointState
from services.bench.bare_browser import BareBrowser, bare_browser
from services.panel.main import Panel
from services.panel.view.browser import STOP_SIGN
from services.panel.view.page import Page
from services.panel.words.en import ENGLISH
from services.runtime.deployment import load_deployment
from services.runtime.process.shutdown import ShutdownRequest
from services.stack.stack import Stack
from tests.gemelo.conftest import BROKER, NEEDED, make_ready
from tests.panel.person import until
from tests.runtime.support import free_port

ARM, LIFT = "brazo_joint", "efector_joint"
LIT = "font-weight:bold"  # of the row of a step that is carried out
POINTS = {"P0": "left", "P1": "ready", "P2": "right"}  # by name, the states at which they are taught


class Served:
    """The page in this process, and somebody at it."""

    def __init__(self, panel: Panel, browser: BareBrowser) -> None:
        self.operator, self.browser, self._panel = panel.operator, browser, panel

    @property
    def page(self) -> Page:
        """As it is built for the browser."""
        [page] = self._panel._present()
        return page

    def press(self, key: str) -> None:
        """The newest button of that word."""
        self.browser.press(STOP_SIGN if key == "stop" else ENGLISH[key])

    def told(self, text: str) -> None:
        """Waits until the page has a problem that says so."""
        until(lambda: self.page._problem.content, lambda content: text in content)

    def says(self, text: str) -> None:
        """Waits until the program's state says so."""
        until(lambda: self.page._programs._state.content, lambda content: text in content)

    def chooses_step(self, number: int) -> None:
        """Of the open program, counted from 1; 0 is its beginning."""
        steps = self.page._programs._step
        steps.value = tuple(steps.options)[number]

    @property
    def lit(self) -> list[str]:
        """The numbers of the steps that are lit."""
        rows = self.page._programs._list.content.split("<div ")[2:]
        return [found[1] for row in rows if LIT in row and (found := re.search(r"<span>([\d.]+)&nbsp;", row))]


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    out, programs = tmp_path_factory.mktemp("out"), tmp_path_factory.mktemp("programs")
    environment = {"GEMELO_ROBOT": "urdf/rm1", "GEMELO_PATHS_PROGRAMS": str(programs)}
    with (
        Stack(broker=BROKER, out=out, processes=NEEDED, environment=environment) as stack,
        pytest.MonkeyPatch.context() as patch,
    ):
        for name, value in stack.deployment.items():
            patch.setenv(name, value)
        patch.setenv("GEMELO_PANEL_PORT", str(free_port()))
        stack.wait_ready(30.0)
        yield stack


@pytest.fixture(scope="module")
def served(twin: Stack) -> Iterator[Served]:
    deployment = load_deployment()
    with gemelo.connect(name="panel", timeout=10.0) as connected:
        panel, stop = Panel(connected, deployment, logging.getLogger("page")), ShutdownRequest()
        thread = threading.Thread(target=panel.run, args=(stop,), daemon=True)
        thread.start()
        try:
            with bare_browser(f"127.0.0.1:{deployment.panel.port}", lambda said, at: None) as browser:
                until(panel._present, bool)
                browser.wait_for(ENGLISH["plan"])
                yield Served(panel, browser)
        finally:
            stop.set()
            thread.join(5.0)
            panel.close()


@pytest.fixture
def arm(twin: Stack) -> Iterator[gemelo.Arm]:
    """Referenced, armed, at rest in "home", at full speed, with an empty scene."""
    twin.wait_ready(30.0)
    with gemelo.connect(timeout=10.0) as connected:
        make_ready(connected)
        connected.move(named="home")
        yield connected


@pytest.fixture
def tour(served: Served, arm: gemelo.Arm) -> None:
    """Three points, and a program that goes to them in their order."""
    teaching = served.operator.teaching
    teaching.stop()
    until(lambda: teaching.is_running, lambda runs: not runs)
    for name in tuple(teaching.points):
        teaching.remove_point(name)
    for name, state in POINTS.items():
        teaching.points.remember(name, arm.states[state])
    teaching._edit(gemelo.programs.Program("tour", ()), is_saved=True)
    for name in POINTS:
        teaching.insert(gemelo.programs.Go(point=name), ())
    until(lambda: tuple(served.page._programs._step.options), lambda options: len(options) == 4)
    served.chooses_step(0)


def rests(arm: gemelo.Arm) -> None:
    until(lambda: arm.velocities, lambda speeds: all(abs(speed) < 1e-3 for speed in speeds.values()))


def stands_at(arm: gemelo.Arm, name: str) -> None:
    wanted = arm.states[POINTS.get(name, name)]
    until(lambda: arm.joints, lambda joints: joints == pytest.approx(wanted, abs=0.02))
    rests(arm)


@contextmanager
def passed(arm: gemelo.Arm) -> Iterator[list[float]]:
    """Where the arm's first joint has been meanwhile [deg]."""
    seen: list[float] = []

    def note(state: JointState) -> None:
        seen.append(degrees(state.position[state.name.index(ARM)]))

    heard = arm.node.subscribe(gemelo.topics.JOINT_STATES, note)
    yield seen
    heard.close()


def test_a_point_is_gone_to_overwritten_renamed_and_removed(served: Served, arm: gemelo.Arm, tour: None) -> None:
    tab, teaching = served.page._teach, served.operator.teaching
    tab._chosen.value = "P0"
    served.press("go_there")
    stands_at(arm, "P0")
    assert served.operator.goal.goal.joints == teaching.points["P0"].joints
    tab._chosen.value = "P2"
    served.press("as_goal")
    until(lambda: served.operator.goal.goal.joints, lambda joints: joints == teaching.points["P2"].joints)
    stands_at(arm, "P0")
    served.press("overwrite")
    until(lambda: teaching.points["P2"].joints, lambda joints: joints == arm.joints)
    tab._name.value = "P0"
    served.press("rename")
    served.told("there is a point &quot;P0&quot;")
    tab._name.value = "by the wall"
    served.press("rename")
    until(lambda: list(teaching.points), lambda names: names == ["P0", "P1", "by the wall"])
    until(lambda: tab._chosen.value, lambda chosen: chosen == "by the wall")
    until(lambda: served.page._problem.content, lambda content: content == "")
    served.browser.press_first(ENGLISH["remove"])  # the tab of the scene has one too
    until(lambda: list(teaching.points), lambda names: names == ["P0", "P1"])
    until(lambda: tab._chosen.value, lambda chosen: chosen == ENGLISH["none"])
    served.press("go_there")
    served.told(ENGLISH["choose_point"])
    rests(arm)


def test_steps_are_put_in_order_stepped_paused_and_run_from_any_and_the_running_one_is_lit(
    served: Served, arm: gemelo.Arm, tour: None
) -> None:
    teaching = served.operator.teaching
    served.chooses_step(3)
    for place in (1, 0):
        served.press("step_up")
        until(lambda place=place: teaching.program.steps[place].point, lambda point: point == "P2")
    until(lambda: served.page._programs._step.value, lambda chosen: chosen == "1  go to P2")
    served.press("step_down")
    until(lambda: [step.point for step in teaching.program.steps], lambda now: now == ["P0", "P2", "P1"])
    served.press("check")
    served.says("The whole program can run")
    assert served.page._programs._list.content.count(" s · ") == 3  # each with its time and its margin
    served.chooses_step(2)
    served.press("one_step")
    until(lambda: served.lit, lambda lit: lit == ["2"])
    served.says("Paused.")
    stands_at(arm, "P2")
    assert served.lit == ["3"]
    served.press("one_step")
    served.says("Done.")
    stands_at(arm, "P1")
    assert served.lit == []
    arm.speed(0.3)
    served.chooses_step(0)
    served.press("run_from")
    until(lambda: served.lit, lambda lit: lit == ["1"])
    until(lambda: served.page._programs._pause.visible, bool)
    served.press("pause")
    served.says("Paused.")
    assert served.page._programs._resume.visible
    arm.speed(1.0)
    served.press("resume")
    served.says("Done.")
    with passed(arm) as seen:
        served.chooses_step(3)
        served.press("run_from")
        served.says("Running.")
        served.says("Done.")
    assert max(seen) - min(seen) < 1.0  # it began where it was told to, at the point where the arm stood


def test_a_program_that_is_stopped_says_where_and_begins_again_only_when_it_is_told_to(
    served: Served, arm: gemelo.Arm, tour: None
) -> None:
    arm.speed(0.3)
    served.press("run_from")
    until(lambda: served.lit, lambda lit: lit == ["2"])
    served.press("stop")
    served.says("Stopped.</b> In step 2.")
    nothing_begins(served, arm)
    served.chooses_step(2)
    arm.speed(1.0)
    served.press("run_from")
    served.says("Done.")
    stands_at(arm, "P2")


def test_an_emergency_stop_in_a_program_says_where_and_after_it_nothing_begins_by_itself(
    served: Served, arm: gemelo.Arm, tour: None
) -> None:
    arm.speed(0.3)
    served.press("run_from")
    until(lambda: served.lit, lambda lit: lit == ["2"])
    arm.device.inject("estop")
    served.says("Failed.</b> Step 2: ")
    served.says("the emergency stop &quot;estop&quot; of device &quot;rm1&quot; is pressed")
    arm.device.inject("estop", value=0)
    arm.device.reset()
    make_ready(arm)
    nothing_begins(served, arm)
    served.chooses_step(2)
    served.press("run_from")
    served.says("Done.")
    stands_at(arm, "P2")


def test_a_planner_that_falls_silent_in_a_program_is_named_with_the_step_and_nothing_begins_by_itself(
    served: Served, arm: gemelo.Arm, tour: None, twin: Stack
) -> None:
    served.press("run_from")
    until(lambda: served.lit, lambda lit: lit == ["1"])
    twin.kill("planner", signal.SIGSTOP)
    try:
        served.says("Failed.</b> Step ")
        served.says("planner")
    finally:
        twin.kill("planner", signal.SIGCONT)
    nothing_begins(served, arm)


def nothing_begins(served: Served, arm: gemelo.Arm) -> None:
    """The arm comes to rest, and stays while what could begin again is asked for its state once more."""
    rests(arm)
    at, state = arm.joints, served.operator.teaching.state
    with passed(arm) as seen:
        until(lambda: len(seen), lambda number: number > 50)
    assert arm.joints == at
    assert served.operator.teaching.state == state
