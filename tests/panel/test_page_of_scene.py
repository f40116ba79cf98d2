"""What a person does in the browser beside goals: edits the scene, holds, homes, jogs by steps."""

from __future__ import annotations

import json
from math import degrees
from pathlib import Path

import pytest

import gemelo
from services.runtime.deployment import project_root
from tests.panel.person import Person, until

ARM = "brazo_joint"
WEDGE = Path("tests/gemelo/wedge.stl")
FILE = "test_page_of_scene.json"


def fills(person: Person, label: str, numbers: tuple[float, ...]) -> None:
    for place, number in enumerate(numbers):
        field = person.row(label).locator("input").filter(visible=True).nth(place)
        field.fill(str(number))
        field.press("Enter")


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
    fills(person, "Size [mm]", (40, 30, 60))
    fills(person, "Middle [mm]", (250, 200, 40))
    person.press("Add")
    until(lambda: arm.scene.objects, lambda objects: list(objects) == ["box_1"])
    person.chooses("Object", "box_1")
    person.reads("box_1: box, ")
    fills(person, "Size [mm]", (50, 30, 60))
    fills(person, "Middle [mm]", (260, 190, 40))
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


def test_a_move_is_held_and_goes_on(person: Person, arm: gemelo.Arm) -> None:
    person.types(f"{ARM} [°]", 150)
    person.press("Plan and execute")
    until(lambda: abs(arm.velocities[ARM]), lambda speed: speed > 0.1)
    person.press("Hold")
    until(lambda: arm.device.state.mode.name, lambda mode: mode == "HOLD")
    until(lambda: abs(arm.velocities[ARM]), lambda speed: speed == 0.0)
    assert degrees(arm.joints[ARM]) < 145.0
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
