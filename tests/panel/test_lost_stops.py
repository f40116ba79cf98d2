"""A Stop while the page is built anew, in a real browser: its button is gone, or another one than the page knows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from playwright.sync_api import Page as Window

from gemelo.schemas.device import StopKind
from gemelo.services.panel.view.browser import STILL_MEANT, STOP_SIGN, Stops
from gemelo.services.panel.view.browser import Browser as Told
from gemelo.services.panel.view.page import Page
from gemelo.tools.chaos.slow_link import SlowLink
from tests.panel.memory_page import MemoryPage, memory_page
from tests.panel.person import OPENING, until
from tests.runtime.support import free_port
from tests.stacks.browser import new_context

HIDE_STOP = f"""() => {{
  const stop = [...document.querySelectorAll('button')].find((b) => b.textContent.trim().startsWith('{STOP_SIGN}'));
  stop.textContent = '';
}}"""


class Opened:
    """A page without a stack, and a window in a real browser that has got all of it over `link`."""

    def __init__(self, memory: MemoryPage, window: Window, link: SlowLink, port: int) -> None:
        self.memory, self.window, self.link = memory, window, link
        before = self.memory.panel.pages()
        window.goto(f"http://127.0.0.1:{port}")
        [self.page] = until(self._drawn_beside(before), lambda pages: len(pages) == 1, OPENING / 1e3)
        until(self.built, lambda built: built is not None and built == self.page.wanted and self.page.was_chosen)
        window.get_by_role("button", name=STOP_SIGN).wait_for(timeout=OPENING)

    def _drawn_beside(self, before: list[Page]):
        def pages() -> list[Page]:
            self.draw()
            return [page for page in self.memory.panel.pages() if page not in before]

        return pages

    def built(self):
        self.draw()
        return self.page.built

    def draw(self) -> None:
        self.memory.draw()
        self.window.wait_for_timeout(20)

    @property
    def stops(self) -> int:
        self.draw()
        return len(self.memory.gateway.stops)


@pytest.fixture
def opened(tmp_path: Path, chromium: Browser) -> Iterator[Opened]:
    with memory_page("rm1", tmp_path) as memory:
        port = free_port()
        link = SlowLink(port, memory.port)
        context = new_context(chromium, viewport={"width": 820, "height": 600}, device_scale_factor=0.5)
        yield Opened(memory, context.new_page(), link, port)
        context.close()
        link.close()


@pytest.mark.parametrize("by", ["space", "the button"])
def test_a_stop_that_is_called_by_a_button_that_the_page_has_just_replaced_is_carried_out_once(
    opened: Opened, by: str
) -> None:
    opened.link.is_stalled = True
    opened.page.wanted = replace(opened.page.wanted, is_dark=not opened.page.wanted.is_dark)
    until(opened.built, lambda built: built == opened.page.wanted)
    if by == "space":
        opened.window.keyboard.press("Space")
    else:
        opened.window.get_by_role("button", name=STOP_SIGN).click()
    assert opened.stops == 0
    opened.link.heal()
    until(lambda: opened.stops, lambda stops: stops == 1)
    assert opened.memory.gateway.stops[0].kind is StopKind.STOP
    opened.window.keyboard.press("Space")  # its button has come, and is told of twice: by its click, and by the count
    until(lambda: opened.stops, lambda stops: stops == 2)
    until(lambda: opened.page.browser, lambda told: told is not None and told.stops == 2 and opened.stops == 2)


def test_a_stop_while_there_is_no_button_is_carried_out(opened: Opened) -> None:
    opened.window.evaluate(HIDE_STOP)
    opened.window.keyboard.press("Space")
    until(lambda: opened.stops, lambda stops: stops == 1)


def test_a_stop_of_long_ago_stops_nothing_when_a_browser_is_connected_again() -> None:
    stops = Stops()
    assert not stops.has_missed(Told(stops=3, stopped_ago=STILL_MEANT))
    assert not stops.has_missed(Told(stops=3, stopped_ago=0.0))
    assert stops.has_missed(Told(stops=4, stopped_ago=900.0))
