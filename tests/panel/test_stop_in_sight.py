"""Stop stays in sight, in a real browser: where its button is scrolled away or covered, another stands in its stead."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import viser
from playwright.sync_api import Browser, Page, expect

from gemelo.services.panel.view.browser import CHANNEL, STOP_SIGN, read_browser, script_html
from tests.panel.person import OPENING, PATIENCE, until
from tests.stacks.browser import new_context

SECOND = "[data-gemelo-stop]"


class Stopped:
    """How often Stop was pressed on a page that is longer than its window."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._clicks = 0
        self.server = server
        server.gui.add_html(script_html())
        self._channel = server.gui.add_text(CHANNEL, CHANNEL)
        stop = server.gui.add_button(f"{STOP_SIGN} Stop")
        for number in range(60):
            server.gui.add_button(f"line {number}")

        @stop.on_click
        def _(_: object) -> None:
            self._clicks += 1

    @property
    def presses(self) -> int:
        """Said in either way, as the operator's page takes them: of two clicks within moments viser sends one."""
        told = read_browser(self._channel.value)
        return max(self._clicks, told.stops if told is not None else 0)


@pytest.fixture
def stopped() -> Iterator[Stopped]:
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield Stopped(server)
    server.stop()


@pytest.fixture
def page(stopped: Stopped, chromium: Browser) -> Iterator[Page]:
    context = new_context(chromium, viewport={"width": 820, "height": 600}, device_scale_factor=0.5)
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{stopped.server.get_port()}")
    page.get_by_role("button", name="line 59").wait_for(timeout=OPENING, state="attached")
    yield page
    context.close()


def test_a_stop_that_is_scrolled_away_is_still_there_to_be_pressed(stopped: Stopped, page: Page) -> None:
    second = page.locator(SECOND)
    expect(second).to_be_hidden(timeout=PATIENCE)
    page.get_by_role("button", name="line 59").scroll_into_view_if_needed(timeout=PATIENCE)
    expect(second).to_be_visible(timeout=PATIENCE)
    expect(second).to_have_text(f"{STOP_SIGN} Stop")
    controls, stop = page.get_by_role("button", name="line 59").bounding_box(), second.bounding_box()
    assert controls is not None
    assert stop is not None
    assert stop["x"] + stop["width"] < controls["x"]  # it covers none of the buttons
    second.click()
    until(lambda: stopped.presses, lambda presses: presses == 1)
    page.get_by_role("button", name="line 0").scroll_into_view_if_needed(timeout=PATIENCE)
    expect(second).to_be_hidden(timeout=PATIENCE)
    page.keyboard.press("Space")
    until(lambda: stopped.presses, lambda presses: presses == 2)


def test_a_stop_that_something_covers_is_still_there_to_be_pressed(stopped: Stopped, page: Page) -> None:
    with stopped.server.gui.add_modal("Save?"):
        stopped.server.gui.add_button("Keep")
    second = page.locator(SECOND)
    expect(second).to_be_visible(timeout=PATIENCE)
    second.click()
    until(lambda: stopped.presses, lambda presses: presses == 1)
