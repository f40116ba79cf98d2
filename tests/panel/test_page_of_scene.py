"""A person's work in the browser beside goals: edits the scene, holds, homes, jogs by steps."""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import expect

import gemelo
from gemelo.libraries.runtime.deployment import project_root
from tests.panel.person import BLUE, Person, until

ARM = "brazo_joint"
WEDGE = Path("tests/gemelo/wedge.stl")
FILE = "test_page_of_scene.json"


@pytest.fixture
def saved():
    path = project_root() / "scenes" / FILE
    path.unlink(missing_ok=True)
    yield path
    path.unlink(missing_ok=True)


def test_an_object_is_added_moved_resized_carried_saved_and_loaded(
    person: Person, arm: gemelo.Arm, saved: Path
) -> None:
    person.tab("Scene")
    person.fills("Size [mm]", (40, 30, 60))
    person.fills("Middle [mm]", (250, 200, 40))
    person.press("Add")
    until(lambda: arm.scene.objects, lambda objects: list(objects) == ["box_1"])
    person.chooses("Object", "box_1")
    person.reads("box_1: box, ")
    person.fills("Size [mm]", (50, 30, 60))
    person.fills("Middle [mm]", (260, 190, 40))
    person.press("Apply size and place")
    until(lambda: arm.scene.objects["box_1"].shape.size, lambda size: size == pytest.approx((0.05, 0.03, 0.06)))
    until(
        lambda: arm.scene.objects["box_1"].pose.translation, lambda at: at == pytest.approx((0.26, 0.19, 0.04))
    )  # fmt: skip
    person.press("Attach to the tool")
    until(lambda: arm.scene.objects["box_1"].attached, bool)
    person.press("Detach")
    until(lambda: arm.scene.objects["box_1"].attached, lambda attached: not attached)
    person.page.locator("input[type=file]").first.set_input_files(WEDGE)
    until(lambda: arm.scene.objects, lambda objects: set(objects) == {"box_1", "wedge"})
    person.page.get_by_text("File", exact=True).filter(visible=True).first.click()
    person.types("File name", FILE)
    person.press("Save")
    until(saved.exists, bool)
    assert {each["name"] for each in json.loads(saved.read_text())["objects"]} == {"box_1", "wedge"}
    person.press("Remove everything")
    until(lambda: arm.scene.objects, lambda objects: not objects)
    person.press("Load")
    until(lambda: arm.scene.objects, lambda objects: set(objects) == {"box_1", "wedge"})
    person.chooses("Object", "wedge")
    person.press("Remove")
    until(lambda: arm.scene.objects, lambda objects: set(objects) == {"box_1"})


def test_the_tool_s_numbers_lead_the_goal_and_what_cannot_be_says_so(person: Person, arm: gemelo.Arm) -> None:
    person.press("Goal to where the arm is")
    label = "Tool x, y, z [mm]"
    until(lambda: person.values(label), lambda now: now[0] == pytest.approx(1000.0 * arm.pose().position[0], abs=0.06))
    person.fills(label, (250, 150, 60))
    until(lambda: goal_of(person, arm), lambda now: now == pytest.approx((0.25, 0.15, 0.06), abs=2e-4))
    person.fills(label, (250, 150, 5000))
    person.reads("Out of reach")
    assert goal_of(person, arm)[:2] == pytest.approx((0.25, 0.15), abs=2e-4)
    assert person.values(label)[2] == 5000.0  # what was asked for stays to be seen, and mended
    person.fills(label, (250, 150, 80))
    until(lambda: goal_of(person, arm), lambda now: now == pytest.approx((0.25, 0.15, 0.08), abs=2e-4))
    assert not any(arm.velocities.values())


def test_a_move_is_held_and_goes_on(person: Person, arm: gemelo.Arm) -> None:
    arm.speed(0.2)  # a browser that draws slowly presses late
    person.types(f"{ARM} [°]", 150)
    person.press("Plan and execute")
    until(lambda: abs(arm.velocities[ARM]), lambda speed: speed > 0.1)
    person.press("Hold")
    until(lambda: arm.device.state.mode.name, lambda mode: mode == "HOLD")
    until(lambda: abs(arm.velocities[ARM]), lambda speed: speed == 0.0)
    assert degrees(arm.joints[ARM]) < 145.0
    arm.speed(1.0)
    person.press("Resume")
    until(lambda: degrees(arm.joints[ARM]), lambda at: abs(at - 150.0) < 0.05)


def test_a_step_of_a_jog_is_as_long_as_it_says(person: Person, arm: gemelo.Arm) -> None:
    person.tab("Jog")
    before = arm.joints[ARM]
    person.chooses("A press moves by", "10 mm / 10°")
    person.press(f"{ARM} +")
    until(lambda: degrees(arm.joints[ARM] - before), lambda went: abs(went - 10.0) < 0.05)
    person.press(f"{ARM} -")
    until(lambda: degrees(arm.joints[ARM] - before), lambda went: abs(went) < 0.05)


def test_homing_says_how_far_it_is(person: Person, arm: gemelo.Arm) -> None:
    person.tab("Device")
    person.press("Home")
    person.reads("Homing: ")
    until(lambda: all(arm.device.state.referenced) and not any(arm.velocities.values()), bool, 120.0)


def test_the_ghost_goes_along_the_plan_until_it_is_executed_and_again_when_asked(
    person: Person, arm: gemelo.Arm
) -> None:
    person.types(f"{ARM} [°]", 60)
    person.press("Plan")
    person.reads("Duration")
    _waits_for_the_ghost(person)
    person.press("Execute")
    person.reads("Arrived")
    person.still_picture()
    person.ticks("Play")
    person.ticks("Play")
    _waits_for_the_ghost(person)
    person.press("Goal to where the arm is")
    expect(person.page.get_by_text("Duration").filter(visible=True)).to_have_count(0)
    person.still_picture()


def _waits_for_the_ghost(person: Person) -> None:
    for before in [person.picture(), person.picture()]:  # it goes on
        until(partial(_changed, person, before), lambda changed: changed > 10)


def _changed(person: Person, before: np.ndarray) -> int:
    return int(person.differs(before).sum())


def test_a_narrow_page_shows_the_arm_however_often_it_is_opened(person: Person, arm: gemelo.Arm) -> None:
    for _ in range(5):
        person.open()
        picture = person.still_picture().astype(int)[100:, :225]  # the drawing, below what viser says of WebGL
        red, green, blue = picture.transpose(2, 0, 1)
        rows, columns = np.nonzero((red > 150) & (red - blue > 80) & (green - blue > 20))  # the upper arm's orange
        assert len(rows) > 100
        assert 70.0 < columns.mean() < 160.0


@pytest.mark.parametrize("way", ["shift", "the switch"])
def test_a_click_on_an_object_sets_the_goal_just_above_its_surface(person: Person, arm: gemelo.Arm, way: str) -> None:
    person.press("Goal to where the arm is")
    before = person.still_picture()
    arm.scene.add_box("table", size=(0.12, 0.12, 0.04), at=(0.1, -0.3, 0.05))
    place = person.drawn_since(before).mean(axis=0)
    was = goal_of(person, arm)
    if way == "shift":
        person.page.mouse.click(*place)  # without the key a click sets nothing
        person.page.keyboard.down("Shift")
    else:
        person.ticks("Goal by click")
    assert goal_of(person, arm) == was
    until(lambda: _clicked_goal(person, arm, place, was), lambda now: now != was)
    person.page.keyboard.up("Shift")
    person.still_picture()
    x, y, z = goal_of(person, arm)
    assert 0.04 < x < 0.16
    assert -0.36 < y < -0.24
    assert 0.06 <= z <= 0.101
    assert not any(arm.velocities.values())


def test_an_object_is_led_by_its_arrow(person: Person, arm: gemelo.Arm) -> None:
    arm.scene.add_box("post", size=(0.03, 0.03, 0.06), at=(0.1, -0.3, 0.05))
    person.tab("Scene")
    before = person.still_picture()
    person.chooses("Object", "post")
    person.reads("post: box, ")
    arrow = person.drawn_since(before, BLUE)
    across, down = arrow[arrow[:, 1] == arrow[:, 1].min()].mean(axis=0)  # the head of the arrow that points up
    person.drags((float(across), float(down) + 5.0), 0, -60)
    at = until(lambda: arm.scene.objects["post"].pose.translation, lambda now: now != (0.1, -0.3, 0.05))
    assert at[:2] == pytest.approx((0.1, -0.3), abs=1e-6)
    assert 0.07 < at[2] < 0.4
    assert arm.scene.objects["post"].shape.size == (0.03, 0.03, 0.06)


def _clicked_goal(
    person: Person, arm: gemelo.Arm, place: np.ndarray, was: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Soon after a click; the browser learns a moment after the switch that it is to tell of clicks."""
    person.page.mouse.click(*place)
    with suppress(AssertionError):
        until(lambda: goal_of(person, arm), lambda now: now != was, 3.0)
    return goal_of(person, arm)


def goal_of(person: Person, arm: gemelo.Arm) -> tuple[float, float, float]:
    """[m] where the tool would stand with the joint values of the page."""
    joints = {}
    for joint in arm.description.joints:
        unit = "mm" if joint.unit == "m" else "°"
        shown = person.value(f"{joint.name} [{unit}]")
        joints[joint.name] = shown / 1000.0 if unit == "mm" else radians(shown)
    return arm.fk(joints).position
