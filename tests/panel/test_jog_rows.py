"""The arrangement of buttons by the page's script, in a real browser: jog buttons in pairs, each with its key."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import viser
from playwright.sync_api import Browser

from gemelo.services.panel.view.browser import CHANNEL, script_html
from tests.panel.person import OPENING, until
from tests.stacks.browser import new_context

LABELS = ("Home", "x +  ▲", "x -  ▼", "z +  PgUp", "z -  PgDn", "a long_joint -", "a long_joint +", "Go + stop")


class Jogged:
    """What was pressed and what was held of jog buttons."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.server, self.pressed, self.held = server, list[str](), list[str]()
        server.gui.add_html(script_html())
        server.gui.add_text(CHANNEL, CHANNEL)
        for label in LABELS:
            button = server.gui.add_button(label)
            button.on_click(lambda event, label=label: self.pressed.append(label))
            button.on_hold(lambda event, label=label: self.held.append(label), callback_hz=20.0)


@pytest.fixture
def jogged() -> Iterator[Jogged]:
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield Jogged(server)
    server.stop()


def test_the_two_jog_buttons_of_an_axis_share_a_row_and_each_key_holds_and_presses_its_own(
    jogged: Jogged, chromium: Browser
) -> None:
    context = new_context(chromium, viewport={"width": 900, "height": 700}, device_scale_factor=0.5)
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{jogged.server.get_port()}")
    try:
        page.get_by_role("button", name="Home").wait_for(timeout=OPENING)

        def rows() -> list[float]:
            boxes = [
                page.get_by_role("button", name=label.replace("  ", " "), exact=True).bounding_box() for label in LABELS
            ]
            return [box["y"] if box is not None else -1.0 for box in boxes]

        home, *pairs, stop = until(rows, lambda seen: seen[1] == seen[2])
        assert pairs[0::2] == pairs[1::2]
        assert len({home, *pairs, stop}) == 5
        page.get_by_role("button", name="Home").click()
        until(lambda: jogged.pressed, lambda pressed: pressed == ["Home"])
        jogged.pressed.clear()
        jogged.held.clear()
        page.keyboard.down("ArrowUp")
        until(lambda: jogged.held, lambda held: len(held) > 2)
        assert jogged.pressed == []
        page.keyboard.up("ArrowUp")
        until(lambda: jogged.pressed, lambda pressed: pressed == ["x +  ▲"])  # a step, where a press makes one
        page.keyboard.press("PageDown")
        until(lambda: jogged.pressed, lambda pressed: pressed == ["x +  ▲", "z -  PgDn"])
        assert set(jogged.held) <= {"x +  ▲", "z -  PgDn"}
    finally:
        context.close()


TOPS = """() => {
  window.tops = [];
  const look = () => {
    const find = (text) => [...document.querySelectorAll('button')].find((b) => b.textContent === text);
    const pair = ['late -', 'late +'].map(find);
    if (pair[0] && pair[1]) window.tops.push(pair.map((b) => b.getBoundingClientRect().top));
    requestAnimationFrame(look);
  };
  look();
}"""


def test_buttons_that_come_later_share_a_row_in_every_frame(jogged: Jogged, chromium: Browser) -> None:
    """So that none moves away below a pointer that is already there."""
    context = new_context(chromium, viewport={"width": 900, "height": 700}, device_scale_factor=0.5)
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{jogged.server.get_port()}")
    try:
        page.get_by_role("button", name="Home").wait_for(timeout=OPENING)
        page.evaluate(TOPS)
        for label in ("late -", "late +"):
            jogged.server.gui.add_button(label)
        tops = until(lambda: page.evaluate("window.tops"), lambda seen: len(seen) > 5)
        assert [pair for pair in tops if pair[0] != pair[1]] == []
    finally:
        context.close()


MARKS = """() => {
  const mark = document.createElement('span');
  document.body.append(mark);
  const renew = (time) => { mark.dataset.gemeloSent = time; requestAnimationFrame(renew); };
  requestAnimationFrame(renew);
}"""


def test_what_the_browser_tells_of_itself_in_every_frame_replaces_no_click(jogged: Jogged, chromium: Browser) -> None:
    """viser sends the newest of the messages of 50 ms, of the page's controls and of the hidden field alike."""
    context = new_context(chromium, viewport={"width": 900, "height": 700}, device_scale_factor=0.5)
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{jogged.server.get_port()}")
    try:
        home = page.get_by_role("button", name="Home")
        home.wait_for(timeout=OPENING)
        page.evaluate(MARKS)
        for count in range(1, 21):
            home.evaluate("(button) => button.click()")
            until(lambda: jogged.pressed, lambda pressed, count=count: pressed == ["Home"] * count)
    finally:
        context.close()
