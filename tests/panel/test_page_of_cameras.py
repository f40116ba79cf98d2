"""The page of an arm with a camera: a click into the image chooses what is picked, and one on nothing says so."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import TimeoutError as NotSeen
from playwright.sync_api import expect

from gemelo.schemas.topics import camera_detections
from gemelo.tools.stack.stack import Stack
from tests.panel.person import OPENING, PATIENCE, Person, place_in_image, until
from tests.stacks.shared import found_by_scripts

CAMERA = "overhead"
WIDTH, HEIGHT = 640.0, 480.0  # [px] of its images
PRESSES = 5  # a page under load may shift between the look for a place and the press there


@pytest.fixture(scope="module")
def twin(cell_stack: Stack) -> Iterator[Stack]:
    with found_by_scripts(cell_stack):
        yield cell_stack


def clicks(person: Person, x: float, y: float) -> None:
    """At a place of the image, in its pixels; slowly, so that the next image may come before the release."""
    person.page.mouse.move(*place_in_image(person.page, CAMERA, x / WIDTH, y / HEIGHT))
    person.page.mouse.down()
    person.page.wait_for_timeout(700.0)
    person.page.mouse.up()


def clicks_until(person: Person, x: float, y: float, said: str) -> None:
    """Until the page says so, which it has not said before."""
    line = person.page.get_by_text(said).filter(visible=True).first
    expect(line).to_be_hidden(timeout=PATIENCE)
    for press in range(1, PRESSES + 1):
        clicks(person, x, y)
        try:
            line.wait_for(timeout=PATIENCE / (PRESSES + 1 - press))
            return
        except NotSeen:
            assert press < PRESSES, f'{PRESSES} clicks, and the page does not say "{said}"'


def test_a_click_on_a_thing_in_the_image_chooses_it_and_pick_this_picks_it(person: Person, arm) -> None:
    arm.move(named="folded")
    newest = arm.node.latest(camera_detections(CAMERA))

    def places() -> dict[str, tuple[float, float]]:
        items = newest.message.items if newest.message is not None else ()
        return {
            item.name: tuple(sum(c[axis] for c in item.corners) / len(item.corners) for axis in (0, 1))
            for item in items
        }

    seen = until(places, lambda found: {"cup", "red_block", "blue_block", "tag 100"} <= set(found))
    person.tab("Scene")
    expect(person.page.locator(f"img[data-gemelo-camera={CAMERA}]")).to_be_visible(timeout=PATIENCE)
    expect(person.page.locator("svg text", has_text="cup")).to_be_attached(timeout=PATIENCE)
    for name in ("red_block", "cup", "blue_block"):
        clicks_until(person, *seen[name], f"{name} is chosen.")
        until(lambda: person.field("Thing").input_value(), lambda value, name=name: value == name)
    clicks_until(person, 0.02 * WIDTH, 0.98 * HEIGHT, "Nothing is detected there; the nearest thing is")
    clicks_until(person, *seen["tag 100"], "tag 100 is no thing of the cell file")
    assert person.field("Thing").input_value() == "blue_block"
    clicks_until(person, *seen["cup"], "cup is chosen.")
    assert not any(item.attached for item in arm.scene.objects.values())
    person.chooses("Place", "bin")
    person.press("Pick this")
    expect(person.page.get_by_text("cup is at bin").first).to_be_visible(timeout=OPENING)  # images, plans and motions
