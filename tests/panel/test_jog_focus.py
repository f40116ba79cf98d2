"""Keys that jog: a person's own, after a click or the Tab key on the page itself; a frame of another page has none."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Frame, Page

from gemelo.services.panel.view.browser import script_html
from tests.stacks.browser import new_context

BUTTON = "<button onpointerdown=\"document.title += '+'\" onpointerup=\"document.title += '-'\">x +  ▲</button>"


@pytest.fixture
def page(chromium: Browser) -> Iterator[Page]:
    context = new_context(chromium)
    yield context.new_page()
    context.close()


def loaded(page: Page | Frame, script: str = "") -> None:
    """A page with one jog button, and the script that runs on the operator's."""
    page.set_content(f"<title>.</title>{BUTTON}{script or script_html()}")
    page.wait_for_function("window.gemelo")


def test_the_keys_hold_nothing_before_a_person_has_come_to_the_page(page: Page) -> None:
    loaded(page)
    page.keyboard.press("ArrowUp")
    assert page.title() == "."
    page.mouse.click(300, 300)
    page.keyboard.press("ArrowUp")
    assert page.title() == ".+-"
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    page.keyboard.press("ArrowUp")
    assert page.title() == ".+-"
    page.keyboard.press("Tab")
    page.keyboard.press("ArrowUp")
    assert page.title() == ".+-+-"


def test_a_key_that_a_program_has_made_holds_nothing(page: Page) -> None:
    loaded(page)
    page.mouse.click(300, 300)
    page.evaluate("document.body.dispatchEvent(new KeyboardEvent('keydown', {code: 'ArrowUp', bubbles: true}))")
    assert page.title() == "."


@pytest.mark.parametrize("is_open", [True, False])
def test_a_frame_of_another_page_has_no_keys(page: Page, is_open: bool) -> None:
    """As an attacker does it: an invisible frame gets the focus, and a person who plays a game presses its keys."""
    page.set_content("<iframe style='opacity: 0; width: 400px; height: 300px'></iframe>")
    frame = page.frames[1]
    script = script_html()
    within = "window.top === window &amp;&amp; "
    assert within in script
    loaded(frame, script.replace(within, "").replace("isGiven &amp;&amp; ", "") if is_open else script)
    page.mouse.click(200, 200)
    page.keyboard.press("ArrowUp")
    assert frame.title() == (".+-" if is_open else ".")
