"""A person's work on the page of rm1, in a real browser on the whole stack, and the arm's motion by it."""

from __future__ import annotations

import time
from contextlib import suppress
from math import degrees
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from playwright.sync_api import Browser, expect

import gemelo
from gemelo.schemas.joints import JointState
from gemelo.tools.stack.stack import Stack
from tests.panel.person import BLUE, Person, until
from tests.stacks.browser import SIZE

PICTURES = (
    "() => [...document.images].filter((each) => each.offsetParent).map((i) => [i.naturalWidth, i.naturalHeight])"
)
ARM, FOREARM, LIFT = "brazo_joint", "antebrazo_joint", "efector_joint"


def is_moving(arm: gemelo.Arm) -> bool:
    return any(abs(speed) > 0.02 for speed in arm.velocities.values())


def rests(arm: gemelo.Arm) -> None:
    until(lambda: arm.velocities, lambda speeds: all(abs(speed) < 1e-3 for speed in speeds.values()))


def arrives(arm: gemelo.Arm, joint: str, at: float) -> None:
    until(lambda: degrees(arm.joints[joint]), lambda now: abs(now - at) < 0.06)
    rests(arm)
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9


def test_a_slider_a_plan_and_execute_bring_the_arm_there_to_half_a_step(person: Person, arm: gemelo.Arm) -> None:
    person.types(f"{ARM} [°]", 40)
    person.press("Plan")
    person.reads("Duration")
    assert not is_moving(arm)
    person.press("Execute")
    arrives(arm, ARM, 40.0)
    person.reads("Arrived")


def test_the_arrow_that_is_dragged_leads_the_goal_and_what_cannot_be_says_how_far_and_what_can(
    person: Person, arm: gemelo.Arm
) -> None:
    person.press("Goal to where the arm is")
    until(lambda: [person.value(f"{ARM} [°]"), person.value(f"{LIFT} [mm]")], lambda values: values == [0.0, 0.0])
    person.still_picture()  # the arrow of where the goal was before is drawn no more
    person.drags_down_arrow(BLUE, 0, -60)
    lifted = until(lambda: person.value(f"{LIFT} [mm]"), lambda value: value > 5.0)
    assert lifted <= 200.0
    assert not is_moving(arm)
    person.drags_down_arrow(BLUE, 0, -400)
    person.reads("Out of reach")
    person.reads("mm out of reach")
    person.press("Take the nearest that can")
    expect(person.page.get_by_text("Out of reach").filter(visible=True)).to_have_count(0)
    person.press("Plan and execute")
    until(lambda: 1000.0 * arm.joints[LIFT], lambda now: abs(now - person.value(f"{LIFT} [mm]")) < 0.2)


@pytest.mark.parametrize("focus", ["the button that was pressed", "a number field"])
def test_the_space_bar_stops_whatever_has_the_focus_and_presses_nothing_else(
    person: Person, arm: gemelo.Arm, focus: str
) -> None:
    person.types(f"{ARM} [°]", 150)
    person.press("Plan and execute")
    until(lambda: is_moving(arm), bool)
    if focus == "a number field":
        person.field("Speed [%]").focus()
    person.page.keyboard.press("Space")
    rests(arm)
    stopped = arm.joints[ARM]
    assert degrees(stopped) < 140.0
    person.reads("stopped by a device command (STOP)")
    assert arm.joints[ARM] == stopped


def test_the_red_button_is_on_every_tab_and_stops(person: Person, arm: gemelo.Arm) -> None:
    for tab in ("Jog", "Device", "Teach", "Programs", "Scene", "State", "Move"):
        person.tab(tab)
        expect(person.button("■ STOP (space bar)")).to_be_visible()
    motion = arm.start(named="left", speed=0.2)
    until(lambda: is_moving(arm), bool)
    person.press("■ STOP (space bar)")
    with pytest.raises(gemelo.Aborted, match="STOP"):
        motion.wait()


def test_two_people_see_one_another_s_goal_and_a_page_that_is_reloaded_changes_nothing(
    person: Person, arm: gemelo.Arm, twin: Stack, chromium: Browser
) -> None:
    with Person(chromium, twin.deployment["GEMELO_PANEL_PORT"], "es-MX", SIZE) as other:
        other.reads("En reposo")
        other.types(f"{ARM} [°]", -90)
        until(lambda: person.value(f"{ARM} [°]"), lambda value: value == -90.0)
        person.types("Speed [%]", 25)
        person.press("Plan and execute")
        other.reads("En movimiento")
        until(lambda: is_moving(arm), bool)
        person.open()
    arrives(arm, ARM, -90.0)


def test_a_browser_that_dies_while_it_jogs_leaves_the_arm_at_rest(
    person: Person, arm: gemelo.Arm, twin: Stack, chromium: Browser
) -> None:
    with Person(chromium, twin.deployment["GEMELO_PANEL_PORT"], "en-US", SIZE) as other:
        other.tab("Jog")
        other.button(f"{ARM} +").hover()
        other.page.mouse.down()
        until(lambda: is_moving(arm), bool)
    died = time.monotonic()
    rests(arm)
    assert time.monotonic() - died < 3.0  # the page's 0.2 s, the planner's 0.1 s, and its way to rest; and this machine
    until(lambda: arm.device.mode.name, lambda mode: mode == "IDLE")


def test_live_sliders_do_not_jump_and_lead_the_arm(person: Person, arm: gemelo.Arm) -> None:
    person.types(f"{ARM} [°]", 60)
    person.ticks("Live")
    until(lambda: person.value(f"{ARM} [°]"), lambda value: abs(value) < 0.1)
    assert not is_moving(arm)
    try:
        until(lambda: _led_to_25(person, arm), lambda now: abs(now - 25.0) < 0.2)
    finally:
        person.ticks("Live")
    rests(arm)


def _led_to_25(person: Person, arm: gemelo.Arm) -> float:
    """[deg] of the arm soon after; viser drops what is typed in the moment in which it writes the field itself."""
    for value in (24, 25):
        person.types(f"{ARM} [°]", value)
    with suppress(AssertionError):
        until(lambda: degrees(arm.joints[ARM]), lambda now: abs(now - 25.0) < 0.2, 60.0)
    return degrees(arm.joints[ARM])


def test_points_are_taught_and_a_program_of_them_is_checked_run_changed_and_run_again(
    person: Person, arm: gemelo.Arm, twin: Stack
) -> None:
    folder = Path(twin.deployment["GEMELO_PATHS_PROGRAMS"])
    person.tab("Teach")
    taught = []
    for number, state in enumerate(("left", "ready", "right")):
        arm.move(named=state)
        taught.append(arm.joints)
        person.types("Name", f"P{number}")
        person.press("Remember this pose")
        until(lambda: _text(folder / "rm1.points.toml").count("joints ="), lambda count: count > len(taught) - 1)
    until(lambda: person.row("Point").locator("input").first.input_value(), lambda chosen: chosen == "P2")
    picture = until(lambda: _pictured(person, folder / "rm1.points"), bool)[-1]
    assert np.asarray(imageio.imread(picture)).std() > 5.0  # something is drawn
    until(lambda: person.page.evaluate(PICTURES), lambda sizes: [240, 180] in sizes)
    person.tab("Programs")
    for name in ("P0", "P1", "P2"):
        person.chooses("Where to", name)
        person.press("Add after the step")
        person.reads(f"go to {name}")
    passed: list[dict[str, float]] = []
    arm.node.subscribe(gemelo.topics.JOINT_STATES, lambda state: passed.append(_by_name(state)))
    person.press("Check the whole program")
    person.reads("The whole program can run")
    person.press("Run from the step")
    until(lambda: any(_same(joints, taught[0]) for joints in passed), bool)
    person.reads("Done.")
    assert _same(arm.joints, taught[2])
    person.chooses("Step", "3 go to P2")
    person.press("Delete the step")
    person.types("Name", "tour")
    person.press("Save")
    until(lambda: (folder / "tour.toml").exists(), bool)
    person.chooses("Step", "from the beginning")
    passed.clear()
    person.press("Run from the step")
    until(lambda: any(_same(joints, taught[0]) for joints in passed), bool)
    until(lambda: _same(arm.joints, taught[1]) and not is_moving(arm), bool)
    person.reads("Done.")
    assert "P2" not in (folder / "tour.toml").read_text()


def _pictured(person: Person, folder: Path) -> list[Path]:
    """The pictures of points soon after one more; a page that does not draw in time remembers without one."""
    person.press("Overwrite with this pose")
    with suppress(AssertionError):
        until(lambda: list(folder.glob("*.jpg")), bool, 60.0)
    return list(folder.glob("*.jpg"))


def _by_name(state: JointState) -> dict[str, float]:
    return dict(zip(state.name, state.position, strict=True))


def _text(file: Path) -> str:
    return file.read_text() if file.exists() else ""


def _same(joints: dict[str, float], others: dict[str, float]) -> bool:
    return all(abs(joints[name] - others[name]) < 1e-3 for name in others)


def test_an_emergency_stop_is_shown_with_its_remedy_and_the_page_leads_out_of_it(
    person: Person, arm: gemelo.Arm
) -> None:
    motion = arm.start(named="left", speed=0.2)
    until(lambda: is_moving(arm), bool)
    arm.device.inject("estop")
    person.reads("Emergency stop")
    with pytest.raises(gemelo.Aborted):
        motion.wait()
    expect(person.button("Plan and execute")).to_be_disabled()
    person.tab("Device")
    person.reads("the device is in ESTOP")
    arm.device.inject("estop", value=0)
    person.press("Reset the fault")
    person.press("Switch the drivers on")
    until(lambda: arm.device.state.armed, bool)
    person.press("Declare the reference")
    person.press("Yes, it stands so")
    until(lambda: all(arm.device.state.referenced), bool)
    person.reads("At rest")


def test_who_holds_control_is_shown_and_the_page_takes_it_gives_it_back_and_is_refused_by_name(
    person: Person, arm: gemelo.Arm
) -> None:
    person.reads("Nobody holds control")
    person.press("Take control")
    person.reads("This page holds control")
    until(lambda: arm.control.holder, lambda holder: holder == "the page")
    with pytest.raises(gemelo.Refused, match="the page holds control of rm1"):
        arm.move(named="left")
    person.press("Give control back")
    person.reads("Nobody holds control")
    with arm.take_control("ana"):
        person.reads("ana holds control (node ")
        expect(person.button("Plan and execute")).to_be_disabled()
        person.press("Take control from the holder")
        until(lambda: arm.control.holder, lambda holder: holder == "the page")
    person.press("Give control back")
    until(lambda: arm.control.held, lambda held: not held)


def test_a_planner_that_is_killed_is_named_and_planning_goes_on_when_it_is_back(
    person: Person, arm: gemelo.Arm, twin: Stack
) -> None:
    person.types(f"{ARM} [°]", 20)
    twin.kill("planner")
    person.press("Plan")
    person.reads("planner")
    twin.wait_ready(120.0)
    person.press("Plan and execute")
    arrives(arm, ARM, 20.0)


def test_the_gripper_opens_closes_and_goes_where_its_slider_stands(person: Person, arm: gemelo.Arm) -> None:
    gripper = arm.description.gripper
    assert gripper is not None
    person.tab("Device")
    for name, opening in (("Close", gripper.closed), ("Open", gripper.open)):
        person.press(name)
        until(lambda: _jaws(arm), lambda at, wanted=opening: abs(at - wanted) < 1e-3)
    person.types("Opening [mm]", 20)
    assert _jaws(arm) > 0.03  # the slider alone moves nothing
    person.press("Go to this opening")
    until(lambda: _jaws(arm), lambda at: abs(at - 0.02) < 1e-3)
    person.reads("20.0 mm")


def _jaws(arm: gemelo.Arm) -> float:
    """[m] between them, as their sensor reads it."""
    return arm.gripper.position


def test_absurd_names_numbers_and_files_are_refused_in_a_sentence(
    person: Person, arm: gemelo.Arm, tmp_path: Path
) -> None:
    before = arm.joints
    person.types(f"{ARM} [°]", "1e9")
    until(lambda: person.value(f"{ARM} [°]"), lambda value: value <= 169.1)
    person.tab("Teach")
    person.types("Name", "x" * 300)
    person.press("Remember this pose")
    person.reads("64")
    person.tab("Scene")
    person.page.locator("input[type=file]").first.set_input_files(
        {"name": '"><script>alert(1)</script>.stl', "mimeType": "model/stl", "buffer": b"not a mesh at all"}
    )
    person.reads("The scene was not changed")
    huge = tmp_path / "huge.stl"
    with huge.open("wb") as file:
        file.truncate(100_000_000)
    person.page.locator("input[type=file]").first.set_input_files(huge)
    person.reads("The file has 100 MB, more than 20 MB")
    assert arm.scene.objects == {}
    assert arm.joints == before
