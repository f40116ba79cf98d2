"""The buttons of points and programs on a whole stack, and the page's sentences then."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator

import pytest

import gemelo
from gemelo.programs import Go, Program
from gemelo.services.panel.words.en import ENGLISH
from gemelo.tools.stack.stack import Stack
from tests.panel.person import until
from tests.panel.served import Served, passed, rests
from tests.simulated import make_ready
from tests.stacks.shared import found_by_scripts

ARM = "brazo_joint"
LIT = "font-weight:bold"  # of the row of a step that is carried out
POINTS = {"P0": "left", "P1": "ready", "P2": "right"}  # by name, the states at which they are taught


@pytest.fixture(scope="module")
def twin(rm1_stack: Stack) -> Iterator[Stack]:
    with found_by_scripts(rm1_stack):
        yield rm1_stack


def says(served: Served, text: str) -> None:
    """Waits until the program's state says so."""
    until(lambda: served.page.programs.state.content, lambda content: text in content)


def chooses_step(served: Served, number: int) -> None:
    """Of the open program, counted from 1; 0 is its beginning."""
    steps = served.page.programs.step
    steps.value = tuple(steps.options)[number]


def runs_step_two(served: Served, arm: gemelo.Arm) -> None:
    """Runs the program at 60 % of its speed, until its second step is lit."""
    arm.speed(0.6)
    served.press("run_from")
    until(lambda: lit(served), lambda now: now == ["2"])


def lit(served: Served) -> list[str]:
    """The numbers of the steps that are lit."""
    rows = served.page.programs.steps.content.split("<div ")[2:]
    return [found[1] for row in rows if LIT in row and (found := re.search(r"<span>([\d.]+)&nbsp;", row))]


@pytest.fixture
def tour(served: Served, arm: gemelo.Arm) -> None:
    """Three points, and a program that goes to them in their order."""
    teaching = served.operator.teaching
    teaching.stop()
    until(lambda: teaching.is_running, lambda runs: not runs)
    teaching.points.reload()  # the stack is shared: its points go with each test
    for name in tuple(teaching.points):
        teaching.remove_point(name)
    for name, state in POINTS.items():
        teaching.points.remember(name, arm.states[state])
    teaching.edit(Program("tour", ()), is_saved=True)
    for name in POINTS:
        teaching.insert(Go(point=name), ())
    until(lambda: tuple(served.page.programs.step.options), lambda options: len(options) == 4)
    chooses_step(served, 0)


def stands_at(arm: gemelo.Arm, name: str) -> None:
    wanted = arm.states[POINTS.get(name, name)]
    until(lambda: arm.joints, lambda joints: joints == pytest.approx(wanted, abs=0.02))
    rests(arm)


def test_a_point_is_gone_to_overwritten_renamed_and_removed(served: Served, arm: gemelo.Arm, tour: None) -> None:
    tab, teaching = served.page.teach, served.operator.teaching
    tab.chosen.value = "P0"
    served.press("go_there")
    stands_at(arm, "P0")
    assert served.operator.goal.goal.joints == teaching.points["P0"].joints
    tab.chosen.value = "P2"
    served.press("as_goal")
    until(lambda: served.operator.goal.goal.joints, lambda joints: joints == teaching.points["P2"].joints)
    stands_at(arm, "P0")
    served.press("overwrite")
    until(lambda: teaching.points["P2"].joints, lambda joints: joints == arm.joints)
    tab.name.value = "P0"
    served.press("rename")
    served.told("there is a point &quot;P0&quot;")
    tab.name.value = "by the wall"
    served.press("rename")
    until(lambda: list(teaching.points), lambda names: names == ["P0", "P1", "by the wall"])
    until(lambda: tab.chosen.value, lambda chosen: chosen == "by the wall")
    until(lambda: served.page.problem.content, lambda content: content == "")
    served.browser.press_exactly(ENGLISH["remove"], 0)  # the tab of the scene has one too
    served.browser.press(ENGLISH["remove_point"])  # it asks first
    until(lambda: list(teaching.points), lambda names: names == ["P0", "P1"])
    until(lambda: tab.chosen.value, lambda chosen: chosen == ENGLISH["none"])
    served.press("go_there")
    served.told(ENGLISH["choose_point"])
    rests(arm)


def test_steps_are_put_in_order_stepped_paused_and_run_from_any_and_the_running_one_is_lit(
    served: Served, arm: gemelo.Arm, tour: None
) -> None:
    teaching = served.operator.teaching
    chooses_step(served, 3)
    for order in (["P0", "P2", "P1"], ["P2", "P0", "P1"]):
        served.press("step_up")
        until(lambda: [step.point for step in teaching.program.steps], order.__eq__)
    until(lambda: served.page.programs.step.value, lambda chosen: chosen == "1  go to P2")
    served.press("step_down")
    until(lambda: [step.point for step in teaching.program.steps], lambda now: now == ["P0", "P2", "P1"])
    served.press("check")
    says(served, "The whole program can run")
    assert served.page.programs.steps.content.count(" s · ") == 3  # each with its time and its margin
    chooses_step(served, 2)
    served.press("one_step")
    until(lambda: lit(served), lambda now: now == ["2"])
    says(served, "Paused.")
    stands_at(arm, "P2")
    assert lit(served) == ["3"]
    served.press("one_step")
    says(served, "Done.")
    stands_at(arm, "P1")
    assert lit(served) == []
    arm.speed(0.6)
    chooses_step(served, 0)
    served.press("run_from")
    until(lambda: lit(served), lambda now: now == ["1"])
    until(lambda: served.page.programs.pause.visible, bool)
    served.press("pause")
    says(served, "Paused.")
    assert served.page.programs.resume.visible
    arm.speed(1.0)
    served.press("resume")
    says(served, "Done.")
    with passed(arm, ARM) as seen:
        chooses_step(served, 3)
        served.press("run_from")
        says(served, "Running.")
        says(served, "Done.")
    assert max(seen) - min(seen) < 0.02  # it began where it was told to, at the point where the arm stood


def test_a_program_that_is_stopped_says_where_and_begins_again_only_when_it_is_told_to(
    served: Served, arm: gemelo.Arm, tour: None
) -> None:
    runs_step_two(served, arm)
    served.press("stop")
    says(served, "Stopped.</b> In step 2.")
    nothing_begins(served, arm)
    chooses_step(served, 2)
    arm.speed(1.0)
    served.press("run_from")
    says(served, "Done.")
    stands_at(arm, "P2")


def test_an_emergency_stop_in_a_program_says_where_and_after_it_nothing_begins_by_itself(
    served: Served, arm: gemelo.Arm, tour: None
) -> None:
    runs_step_two(served, arm)
    arm.device.inject("estop")
    says(served, "Failed.</b> Step 2: ")
    says(served, "the emergency stop &quot;estop&quot; of device &quot;rm1&quot; is pressed")
    arm.device.inject("estop", value=0)
    arm.device.reset()
    make_ready(arm)
    nothing_begins(served, arm)
    chooses_step(served, 2)
    served.press("run_from")
    says(served, "Done.")
    stands_at(arm, "P2")


def test_a_planner_that_falls_silent_in_a_program_is_named_with_the_step_and_nothing_begins_by_itself(
    served: Served, arm: gemelo.Arm, tour: None, twin: Stack
) -> None:
    served.press("run_from")
    until(lambda: lit(served), lambda now: now == ["1"])
    twin.kill("planner", signal.SIGSTOP)
    try:
        says(served, "Failed.</b> Step ")
        says(served, "planner")
    finally:
        twin.kill("planner", signal.SIGCONT)
    nothing_begins(served, arm)


def nothing_begins(served: Served, arm: gemelo.Arm) -> None:
    """The arm comes to rest, and stays while what could begin again is asked for its state once more."""
    rests(arm)
    at, state = arm.joints, served.operator.teaching.state
    with passed(arm, ARM) as seen:
        until(lambda: len(seen), lambda number: number > 50)
    assert arm.joints == at
    assert served.operator.teaching.state == state
